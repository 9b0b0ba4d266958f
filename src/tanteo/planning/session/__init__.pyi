from .answer import answered as answered
from .answer import moved as moved
