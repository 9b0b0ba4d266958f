"""Sensing as a conversation: ``ask()`` gives the next reading to make, ``tell(readings)`` what came of it.

The only thing here with memory. It touches no file and moves no hand::

    session = Session(around(targets, T_world_place, covariance), probe_of(sensor_preset("keyence_il300")), sensing=...)
    while isinstance(action := session.ask(), Action):
        session.tell(action.read(measured_range))
    print(session.answer().message)
"""
