"""Policy files and ONNX files from trained models."""
