from . import arm as arm
from .scene import Scene as Scene
from .scene import Solid as Solid
from .scene import box as box
from .scene import clearances as clearances
from .simulated import Cell as Cell
from .simulated import SimulatedHand as SimulatedHand
