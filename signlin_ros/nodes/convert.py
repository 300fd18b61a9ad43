"""Messages to arrays and back; the only place that knows ROS time and the layout of messages.

Reading never raises: a bad message gives a `Refusal`, which says why.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from signlin_ros.linearization import Linearization
from signlin_ros.model import Model
from signlin_ros.nodes.told import NANO, Refusal, Update

if TYPE_CHECKING:
    from signlin_ros.nodes.monitor_logic import MonitorScore

Array = NDArray[np.float64]
JOINT_FIELDS = ("position", "velocity", "effort")


# -------------------------------------------------------------------- time


def nanoseconds(stamp: Time) -> int:
    """Return a stamp as whole nanoseconds."""
    return int(stamp.sec) * NANO + int(stamp.nanosec)


def stamp_of(nanosec: int) -> Time:
    """Return whole nanoseconds as a stamp."""
    return Time(sec=nanosec // NANO, nanosec=nanosec % NANO)


# -------------------------------------------------------------------- reading


def read_vector(message: Float64MultiArray, length: int) -> Array | Refusal:
    """Return the (length,) values of a message, or why it is refused: its layout, its length, or a value."""
    data = np.array(message.data, dtype=np.float64)
    fault = layout_fault(message.layout, data.size)
    if fault:
        return Refusal("layout", fault)
    if data.size != length:
        return Refusal("length", f"{data.size} values, not {length}")
    if not np.isfinite(data).all():
        return Refusal("not_finite", f"value {int(np.argmin(np.isfinite(data)))} is not finite")
    return data


def read_input(message: Float64MultiArray, model: Model) -> Array | Refusal:
    """Return the inputs (m,) in a message, or why it is refused; optional ones at the end may be left out."""
    least, most = len(model.plant.inputs), len(model.inputs)
    count = len(message.data) if least <= len(message.data) <= most else most
    found = read_vector(message, count)
    return found if isinstance(found, Refusal) else np.concatenate([found, model.u0[count:]])


def layout_fault(layout: Any, size: int) -> str:
    """Return the error of the layout of a vector of ``size`` values; an empty text if there is none.

    An empty layout is fine. Otherwise the sizes must multiply to the number of values, at most one may differ
    from 1, each stride must be the product of the sizes from there on, and the offset must be 0. Python's
    integers do not overflow, whatever is claimed.
    """
    if layout.data_offset:
        return f"data_offset {layout.data_offset}, not 0"
    sizes = [int(dim.size) for dim in layout.dim]
    if not sizes:
        return ""
    if math.prod(sizes) != size:
        return f"sizes {sizes} for {size} values"
    if sum(one != 1 for one in sizes) > 1:
        return f"sizes {sizes}: not a vector"
    strides = [int(dim.stride) for dim in layout.dim]
    expected = [math.prod(sizes[i:]) for i in range(len(sizes))]
    return "" if strides == expected else f"strides {strides}, not {expected}"


def read_joint(message: JointState, joint: str) -> dict[str, float] | Refusal:
    """Return position, velocity and effort of a joint, found by its name; absent or NaN ones are left out."""
    names = list(message.name)
    if joint not in names:
        return Refusal("missing", f"no joint {joint!r} among {names[:10]}")
    index = names.index(joint)
    found = {}
    for field in JOINT_FIELDS:
        values = getattr(message, field)
        value = float(values[index]) if index < len(values) else math.nan
        if math.isinf(value * value):  # no variance holds it: of an observer nothing would be left
            return Refusal(
                "not_finite", f"{field} is not finite" if math.isinf(value) else f"{field} {value:g} squared"
            )
        if not math.isnan(value):
            found[field] = value
    return found


def read_joints(message: JointState, joints: Sequence[str]) -> dict[str, float] | Refusal:
    """Return position, velocity and effort of several joints by their names, ``elbow.position``; see `read_joint`.

    Refused: a joint that is not there, or that has no position or no velocity, named.
    """
    found: dict[str, float] = {}
    for joint in joints:
        one = read_joint(message, joint)
        if isinstance(one, Refusal):
            return Refusal(one.kind, f"{joint}: {one.detail}" if one.kind != "missing" else one.detail, joint)
        lost = [name for name in ("position", "velocity") if name not in one]
        if lost:
            return Refusal("missing", f"no {' and no '.join(lost)} of joint {joint!r}", joint)
        found |= {f"{joint}.{name}": value for name, value in one.items()}
    return found


def joints_state(values: Mapping[str, float], joints: Sequence[str], stamp: int) -> JointState:
    """Return values by name, ``elbow.position``, as a message of several joints, its time in ns."""
    fields = {field: [float(values.get(f"{joint}.{field}", math.nan)) for joint in joints] for field in JOINT_FIELDS}
    message = JointState(name=list(joints), **fields)
    message.header.stamp = stamp_of(stamp)
    return message


# -------------------------------------------------------------------- writing


def vector(values: ArrayLike, label: str) -> Float64MultiArray:
    """Return (n,) values as a message with one labelled dimension."""
    data = np.asarray(values, dtype=np.float64)
    return _array(data, [(label, data.size, data.size)])


def matrix(values: ArrayLike, rows: str, columns: str) -> Float64MultiArray:
    """Return (r, c) values as a message, row-major with two labelled dimensions."""
    data = np.asarray(values, dtype=np.float64)
    r, c = data.shape
    return _array(data, [(rows, r, r * c), (columns, c, c)])


def _array(data: Array, dims: Sequence[tuple[str, int, int]]) -> Float64MultiArray:
    message = Float64MultiArray(data=data.ravel().tolist())
    message.layout.dim = [MultiArrayDimension(label=name, size=size, stride=stride) for name, size, stride in dims]
    return message


MODEL_LABEL = "sec, nanosec, sequence, in_valid_range, n, m, A row-major, B row-major, c, x_k, u_k"
"""What stands in ``~/model``, one after the other."""


def model_message(update: Update) -> Float64MultiArray:
    """Return one update as the flat message of ``~/model``; its label names the layout."""
    r = update.result
    n, m = r.B.shape
    head = (*divmod(update.stamp, NANO), update.sequence, r.in_valid_range, n, m)
    parts = (np.array(head, dtype=np.float64), r.A.ravel(), r.B.ravel(), r.c, r.x, r.u)
    return vector(np.concatenate(parts), MODEL_LABEL)


def read_model(message: Float64MultiArray) -> Update:
    """Return the update in a message of ``~/model``, for programs that use it.

    ``f`` is A x + B u + c; method and delay are not in the message and come back empty and 0.
    """
    head, data = message.data[:6], np.array(message.data[6:], dtype=np.float64)
    n, m = int(head[4]), int(head[5])
    A, B, c, x, u = np.split(data, np.cumsum([n * n, n * m, n, n]))
    A, B = A.reshape(n, n), B.reshape(n, m)
    f = A @ x + B @ u + c
    result = Linearization(A=A, B=B, c=c, x=x, u=u, f=f, method="", in_valid_range=bool(head[3]), delay=0.0)
    return Update(stamp=int(head[0]) * NANO + int(head[1]), sequence=int(head[2]), result=result)


ERROR_LABEL = "sec, nanosec, n, error of A B c, error without friction, RMS of both over the window, fit in percent"
"""What stands in ``~/error``: two numbers of the stamp, n, then five times n values."""


def error_message(score: MonitorScore) -> Float64MultiArray:
    """Return a score as the flat message of ``~/error``; its label names the layout."""
    head = [*divmod(score.stamp, NANO), len(score.error)]
    values = [*head, *score.error, *score.bare, *score.rms, *score.rms_bare, *score.fit]
    return vector([float(value) for value in values], ERROR_LABEL)


def joint_state(joint: str, values: Mapping[str, float], nanosec: int) -> JointState:
    """Return a message for one joint; fields that are not in ``values`` stay empty."""
    message = JointState(name=[joint])
    message.header.stamp = stamp_of(nanosec)
    for field, value in values.items():
        setattr(message, field, [float(value)])
    return message
