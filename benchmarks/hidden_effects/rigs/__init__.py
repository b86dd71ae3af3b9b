"""Rigs of other labs: joints, slides and imposed motions of all sizes, as data sets with a truth.

Written without the laws, the plant and the older generator: half of the cases come from MuJoCo
(`mujoco_axis`), half from integrators of this folder (`stick_slip`, `imposed`). Coordinates are SI;
q is the position of the axis in m or rad, a positive drive pushes towards positive q.
"""
