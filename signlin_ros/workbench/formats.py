"""The files that Use writes for other tools, by target: names only, for server and page."""

FILES = {
    "mjcf": ("model_mjcf.xml",),
    "c": ("model.c", "model.h"),
    "fmu": ("model.fmu",),
    "python-control": ("model_control.py",),
    "casadi": ("model_casadi.py",),
    "do-mpc": ("model_do_mpc.py",),
    "sympy": ("model_sympy.py",),
    "urdf": ("model.urdf",),
    "sdf": ("model.sdf",),
    "bam": ("model_bam.json",),
    "isaaclab": ("model_isaaclab.py",),
}
"""By target of `signlin export`."""

__all__ = ["FILES"]
