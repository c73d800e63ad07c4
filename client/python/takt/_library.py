# SPDX-License-Identifier: Apache-2.0
"""takt/client.h for ctypes: structures, codes and functions as that header declares them."""
import ctypes
import pathlib
from ctypes import POINTER, c_char_p, c_float, c_int64, c_uint32, c_uint64, c_void_p

ABI = 1
SONAME = f"libtakt-client.so.{ABI}"
OK, NOTHING, USAGE, BAD_CONFIG, REFUSED, BUG = 0, 1, 64, 65, 69, 70
KINDS = {"q": 0, "dq": 1, "tau": 2, "q_setpoint": 3, "dq_of_drive": 7}
STREAM, IMAGE, QUEUE = 4, 5, 6
JOINS = ("replace", "cross_fade", "blend", "ensemble", "align", "quintic", "prefix", "rtc")  # rtc is prefix
FLOAT32, UINT8 = 0, 1
FloatP = POINTER(c_float)


class TermStruct(ctypes.Structure):
    _fields_ = [("kind", c_uint32), ("values", c_uint32), ("stream", c_char_p), ("unit", c_char_p), ("max_age", c_char_p)]


class SpecStruct(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("term_count", c_uint32), ("terms", POINTER(TermStruct)), ("robot_file", c_char_p),
                ("runtime_directory", c_char_p), ("program", c_char_p), ("step", c_char_p), ("steps", c_uint32),
                ("reserved", c_uint32), ("candidate_file", c_char_p), ("join", c_char_p)]


class RobotStruct(ctypes.Structure):
    _fields_ = [("name", c_char_p), ("policy_file", c_char_p), ("policy_hash", c_uint64), ("joint_count", c_uint32),
                ("steps", c_uint32), ("joints", POINTER(c_char_p)), ("home", FloatP), ("period_ns", c_int64), ("step_ns", c_int64)]


class QueueStruct(ctypes.Structure):
    _fields_ = [("values", FloatP), ("sensed_ns", POINTER(c_int64)), ("count", c_uint32), ("capacity", c_uint32),
                ("value_count", c_uint32), ("reserved", c_uint32), ("dropped", c_uint64)]


class ObservationStruct(ctypes.Structure):
    _fields_ = [("id", c_uint64), ("dropped", c_uint64), ("published_ns", c_int64), ("sensed_ns", c_int64),
                ("outside_sensed_ns", c_int64), ("values", FloatP), ("mode", c_char_p), ("value_count", c_uint32),
                ("reset", c_uint32), ("images", POINTER(c_void_p)), ("image_count", c_uint32), ("reserved", c_uint32),
                ("following", c_uint64), ("committed_from", c_uint32), ("committed_count", c_uint32), ("queues", POINTER(QueueStruct)),
                ("queue_count", c_uint32), ("reserved_too", c_uint32), ("committed", c_void_p)]


class StreamStruct(ctypes.Structure):
    _fields_ = [("name", c_char_p), ("unit", c_char_p), ("timeout_ns", c_int64), ("type", c_uint32), ("values", c_uint32),
                ("height", c_uint32), ("width", c_uint32), ("channels", c_uint32), ("reserved", c_uint32)]


class SensorSpecStruct(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("type", c_uint32), ("robot_file", c_char_p), ("runtime_directory", c_char_p), ("name", c_char_p),
                ("unit", c_char_p), ("policy_user", c_char_p), ("values", c_uint32), ("height", c_uint32), ("width", c_uint32),
                ("channels", c_uint32)]


class AlternativesStruct(ctypes.Structure):
    _fields_ = [("kept", c_uint64), ("taken", c_uint64), ("outdone", c_uint64), ("unmatched", c_uint64), ("dropped", c_uint64)]


class AssumptionStruct(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("reserved", c_uint32), ("at_ns", c_int64), ("q", c_char_p), ("dq", c_char_p)]


class ChunkStruct(ctypes.Structure):
    # The numbers as bytes: c_char_p is the one type that takes them, and their address, in one step.
    _fields_ = [("size", c_uint32), ("reserved", c_uint32), ("q", c_char_p), ("dq", c_char_p), ("kp", c_char_p),
                ("kd", c_char_p), ("tau_ff", c_char_p), ("assumes", POINTER(AssumptionStruct))]


FUNCTIONS = {
    "takt_policy_open": [POINTER(SpecStruct), POINTER(c_void_p), c_char_p, c_uint32],
    "takt_policy_attach": [c_void_p, c_int64],
    "takt_policy_next": [c_void_p, c_int64],
    "takt_sensor_open": [POINTER(SensorSpecStruct), POINTER(c_void_p), c_char_p, c_uint32],
}
QUICK_FUNCTIONS = {  # they return at once: other threads need not be let in meanwhile
    "takt_policy_infer_begin": [c_void_p],
    "takt_policy_infer_end": [c_void_p],
    "takt_policy_publish": [c_void_p, POINTER(ChunkStruct)],
    "takt_policy_state_problem": [c_void_p, c_char_p],
    "takt_policy_state_source": [c_void_p, c_char_p],
    "takt_sensor_publish": [c_void_p, c_int64],
}


def place() -> str:
    """Beside this package, as in a wheel; else what the checkout built that it is of; else where the system has it."""
    folder = pathlib.Path(__file__).resolve().parent
    places = [folder / SONAME]
    if folder.parts[-3:] == ("client", "python", "takt"):
        places.append(folder.parents[2] / "build/release/lib" / SONAME)
    return next((str(file) for file in places if file.exists()), SONAME)


def load() -> ctypes.CDLL:
    """The library of this package. ImportError where it does not fit."""
    try:
        library = ctypes.CDLL(place())
    except OSError as error:
        raise ImportError(f"takt: {SONAME} cannot be loaded: {error}; install Takt's package, or in a checkout run ./dev build") from None
    library.takt_client_abi.restype = c_uint32
    if library.takt_client_abi() != ABI:
        raise ImportError(f"takt: {SONAME} has ABI {library.takt_client_abi()}, this package wants {ABI}: install both from one version")
    quick = ctypes.PyDLL(library._name)
    for source, functions in ((library, FUNCTIONS), (quick, QUICK_FUNCTIONS)):
        for name, arguments in functions.items():
            function = getattr(source, name)
            function.argtypes, function.restype = arguments, ctypes.c_int
            setattr(library, name, function)
    for name, result in {"takt_policy_robot": POINTER(RobotStruct), "takt_policy_observation": POINTER(ObservationStruct),
                         "takt_policy_alternatives": POINTER(AlternativesStruct),
                         "takt_policy_sentence": c_char_p, "takt_policy_detach": None,
                         "takt_policy_close": None, "takt_sensor_values": c_void_p, "takt_sensor_stream": POINTER(StreamStruct),
                         "takt_sensor_sentence": c_char_p, "takt_sensor_close": None}.items():
        getattr(library, name).argtypes = [c_void_p]
        getattr(library, name).restype = result
    library.takt_policy_stream.argtypes = [c_void_p, c_char_p]
    library.takt_policy_stream.restype = POINTER(StreamStruct)
    return library
