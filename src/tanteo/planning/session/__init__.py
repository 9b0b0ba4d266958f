"""Sequential sensing with the ask-and-tell interface of sequential optimizers.

``ask()`` returns the next reading to make, and ``tell(readings)`` adds its result to the posterior. A session is the
only object of this package with a state. It opens no file and moves no hand::

    session = Session(around(targets, T_world_place, covariance), probe_of(sensor_preset("keyence_il300")), sensing=...)
    while isinstance(action := session.ask(), Action):
        session.tell(action.read(measured_range))
    print(session.answer().message)
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
