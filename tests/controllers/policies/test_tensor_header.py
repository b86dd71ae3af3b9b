"""What a file of weights announces is held against what it has, before memory is taken."""

import json

import numpy as np
import pytest

pytest.importorskip("safetensors")

from safetensors.numpy import save

from controllers.policies.tensors import LARGEST_HEADER, check_header

SOUND = save({"a": np.zeros((3, 4), np.float32), "b": np.arange(5.0)})


def blob(header, data=b"\0" * 8):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data


def tensor(**changed):
    return {"a": {"dtype": "F64", "shape": [1], "data_offsets": [0, 8]} | changed}


def test_a_sound_file_is_described():
    header = check_header(SOUND, len(SOUND))
    assert header["a"]["shape"] == [3, 4] and header["b"]["dtype"] == "F64"
    assert check_header(blob(tensor()), len(blob(tensor())))


HOSTILE = {
    "empty": (b"", "header must be at most"),
    "a header of exabytes": (b"\xff" * 8 + b"{}", "it announces 18446744073709551615"),
    "cut off": (SOUND[:-3], "cut off or changed"),
    "too long": (SOUND + b"x", "cut off or changed"),
    "no JSON": (blob(b"{x"), "is not valid JSON"),
    "deep": (blob(b"[" * 100_000), "nesting"),
    "a list": (blob(b"[]"), "must be an object"),
    "terabytes": (blob(tensor(shape=[2**40])), "do not fit"),
    "overflow": (blob(tensor(shape=[2**32, 2**32])), "do not fit"),
    "negative": (blob(tensor(shape=[-1, -1])), "must be a whole number"),
    "NaN": (blob(b'{"a": {"shape": [NaN]}}'), "NaN"),
    "unknown kind": (blob(tensor(dtype="F1024")), "do not fit"),
    "text": (blob(tensor(shape="x")), "must be a list"),
    "offsets": (blob(tensor(data_offsets=[8, 0])), "do not fit"),
    "one offset": (blob(tensor(data_offsets=[8])), "must be a list of 2"),
    "overlap": (blob(tensor() | {"b": tensor()["a"]}), "overlap or leave gaps"),
    "dimensions": (blob(tensor(shape=[1] * 100)), "do not fit"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_hostile_header_is_one_message(case):
    content, message = HOSTILE[case]
    with pytest.raises(ValueError, match=message) as caught:
        check_header(content[: 8 + LARGEST_HEADER], len(content))
    assert len(str(caught.value)) < 300
