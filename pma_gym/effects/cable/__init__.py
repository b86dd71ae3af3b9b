"""The cable between pulley and slide, and the loads at the pulley: hanging weights or a leg."""
