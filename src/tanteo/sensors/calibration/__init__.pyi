from . import targets as targets
from .hand_eye import HandEye as HandEye
from .hand_eye import calibrate_hand_eye as calibrate_hand_eye
from .result import BeamFit as BeamFit
from .result import Calibration as Calibration
from .result import DeviceFit as DeviceFit
from .result import plane_angle as plane_angle
from .rig import calibrated_rig as calibrated_rig
