"""Sentences of a hand: how its motions and its acquisitions of features ended."""

from __future__ import annotations

import math

from tanteo.words import findings as f
from tanteo.words.figures import listed, millimetres, readings
from tanteo.words.sentences.base import Words, sentence, words_of

_ADVICE = {
    "acquired": "",
    "nothing": "Give a better initial guess of its place, or start nearer to it.",
    "lost": "Start more squarely before the face, or choose a wider one.",
    "limit": "Give the hand more free space, a smaller stand-off, or a start from another side.",
    "timeout": "Start nearer.",
    "unclear": "Sense it from another place, or sense the faces beside it.",
}
"""What to do after an acquisition, by its status."""


def acquisition_message(status: str, finding: f.Finding) -> str:
    """Return how an acquisition ended and what to do.

    Args:
        status: status of the acquisition.
        finding: reason for the status.
    """
    return " ".join(filter(None, [sentence(finding), _ADVICE[status]]))


def _count(n: int, noun: str) -> str:
    return f"1 {noun}" if n == 1 else f"{n} {noun}s"


def _bend(angle: float) -> str:
    """Return the angle of a bend."""
    return "too steeply for the sensors" if math.isinf(angle) else f"by about {math.degrees(angle):.0f} deg"


def _degrees(angle: float) -> str:
    return "some degrees" if math.isnan(angle) else f"{math.degrees(angle):.0f} deg"


def _rim_cause(one: f.FewRimPlaces) -> str:
    """Return why the places do not determine the circle of a rim."""
    return {
        "few": "too few to check each other",
        "spread": "which cover too little of it to determine a circle",
        "open": f"none of them on {_degrees(one.angle)} of it, where it may be open",
        "alone": "one of them far from all others",
    }[one.cause]


@words_of.register
def _(one: f.AtPose) -> Words:
    return "The hand is at the demanded pose.", ""


@words_of.register
def _(one: f.AtRest) -> Words:
    return f"{readings(one.count)} at rest {'was' if one.count == 1 else 'were'} made.", ""


@words_of.register
def _(one: f.SurroundingsScanned) -> Words:
    return "The hand scanned its surroundings.", ""


@words_of.register
def _(one: f.AtStandoff) -> Words:
    distance = millimetres(one.distance, 3)
    if one.square:
        return f"The hand is square to the surface, {distance} from it.", ""
    return f"The hand is {distance} before the surface.", ""


@words_of.register
def _(one: f.MovedBack) -> Words:
    return f"The hand moved back by {millimetres(one.distance, 3)}.", ""


@words_of.register
def _(one: f.Followed) -> Words:
    return f"The hand followed the surface for {millimetres(one.distance, 3)}.", ""


@words_of.register
def _(one: f.EdgeCrossed) -> Words:
    return f"{_count(one.sensors, 'sensor')} crossed the edge {_count(one.crossings, 'time')}.", ""


@words_of.register
def _(one: f.NearSurface) -> Words:
    return f"The hand cannot go on: sensor '{one.sensor}' is near a surface.", ""


@words_of.register
def _(one: f.AtLimit) -> Words:
    return f"The hand cannot go on: it is at {one.limit}.", ""


@words_of.register
def _(one: f.TimedOut) -> Words:
    return f"The motion took longer than {one.seconds:g} s.", ""


@words_of.register
def _(one: f.NothingInRange) -> Words:
    return "No beam met anything within its range.", ""


@words_of.register
def _(one: f.NoSurfaceAhead) -> Words:
    return f"No surface is within {millimetres(one.reach, 3)} ahead.", ""


@words_of.register
def _(one: f.NoRanges) -> Words:
    return "The surface gives no ranges: the beams meet it too obliquely.", ""


@words_of.register
def _(one: f.NotUnderSensors) -> Words:
    return f"The surface is {'not under both frontal sensors' if one.both else 'under neither frontal sensor'}.", ""


@words_of.register
def _(one: f.TwoSurfaces) -> Words:
    return f"The two sensors are not over one surface: it would have a tilt of {math.degrees(one.angle):.0f} deg.", ""


@words_of.register
def _(one: f.SurfaceEnded) -> Words:
    return f"The surface ended after {millimetres(one.distance, 3)}.", ""


@words_of.register
def _(one: f.SurfaceBent) -> Words:
    return f"The surface bent away after {millimetres(one.distance, 3)}.", ""


@words_of.register
def _(one: f.BendsAway) -> Words:
    return f"The surface does not end, it bends away {_bend(one.angle)}.", ""


@words_of.register
def _(one: f.NoEdge) -> Words:
    return f"The surface does not end within {millimetres(one.reach, 3)}.", ""


@words_of.register
def _(one: f.EdgeNotRepeated) -> Words:
    return "The surface ended at different places on the way out and back.", ""


@words_of.register
def _(one: f.NotCrossed) -> Words:
    return "No beam crossed the rim.", ""


@words_of.register
def _(one: f.NoSpace) -> Words:
    return f"There is no free space for the hand {one.place}.", ""


@words_of.register
def _(one: f.NotAllSeen) -> Words:
    return f"The space {one.place} was not seen completely.", ""


@words_of.register
def _(one: f.SpaceEnds) -> Words:
    distance = millimetres(max(one.distance, 0.0), 3)
    return f"The known free space ends after {distance}, and the surface does not end there.", ""


@words_of.register
def _(one: f.NoFlatFace) -> Words:
    return "No flat face was seen where it should be.", ""


@words_of.register
def _(one: f.FacesTooNarrow) -> Words:
    return "No face is wide enough for both sensors.", ""


@words_of.register
def _(one: f.FaceNotRepeated) -> Words:
    return "The face was not found at the same place twice.", ""


@words_of.register
def _(one: f.OtherFace) -> Words:
    off = f"{millimetres(one.distance)} and {math.degrees(one.angle):.2g} deg"
    sd = f"{millimetres(one.sd)} and {math.degrees(one.angle_sd):.2g} deg"
    return f"The sensed face is {off} away from the expected one, whose sd is {sd}.", ""


@words_of.register
def _(one: f.ScanTooShort) -> Words:
    return "The scan is too short to determine the tilt of the face.", ""


@words_of.register
def _(one: f.SurfaceLost) -> Words:
    return "The surface was under the frontal sensors for too short a time.", ""


@words_of.register
def _(one: f.ReadingsTaken) -> Words:
    return f"{readings(one.count)} {'was' if one.count == 1 else 'were'} taken.", ""


@words_of.register
def _(one: f.NotOneFeature) -> Words:
    return f"The readings are not of one {one.feature}: {one.cause.rstrip('.')}.", ""


@words_of.register
def _(one: f.EdgeAlongFace) -> Words:
    return "The expected edge runs along the normal of the sensed face.", ""


@words_of.register
def _(one: f.EdgeAtOnePlace) -> Words:
    return "The sensors crossed the edge at one place only.", ""


@words_of.register
def _(one: f.FewEdgeCrossings) -> Words:
    where = "and one place is far from all others" if one.alone else "at too few places"
    return f"The edge was crossed {_count(one.count, 'time')}, {where}.", ""


@words_of.register
def _(one: f.EdgesMixed) -> Words:
    return f"An edge was crossed {_count(one.count, 'time')}, and this one only {_count(one.own, 'time')}.", ""


@words_of.register
def _(one: f.PlaceBeside) -> Words:
    return f"One place is {one.sds:.1f} standard deviations beside the {one.shape} of the others.", ""


@words_of.register
def _(one: f.EdgeOffFace) -> Words:
    side = "below" if one.offset < 0 else "above"
    return (
        f"The sensed edge is {millimetres(abs(one.offset))} {side} the face: the border seems to be bevelled or "
        "rounded."
    ), "Acquire the two faces beside it; their planes meet in the edge."


@words_of.register
def _(one: f.FaceEndsElsewhere) -> Words:
    ends = "continues beyond" if one.beyond else "ends before"
    return f"Between the places of the crossings the face {ends} their line.", ""


@words_of.register
def _(one: f.CreaseSensed) -> Words:
    return "The surface bends: the edge is where the planes of both faces meet.", ""


@words_of.register
def _(one: f.CreaseOff) -> Words:
    return f"The planes of both faces meet {millimetres(one.distance)} beside the bend of the surface.", ""


@words_of.register
def _(one: f.RimNotSeen) -> Words:
    text = f"The beams show no {'boss' if one.convex else 'bore'} in the face near its expected place."
    if math.isnan(one.narrowest):
        return text, ""
    return f"{text} At this stand-off they show none narrower than {millimetres(one.narrowest)}.", ""


@words_of.register
def _(one: f.BoreTooNarrow) -> Words:
    least = millimetres(one.narrowest)
    return f"The bore is narrower than the {least} that a beam needs at this stand-off.", "Decrease the stand-off."


@words_of.register
def _(one: f.FewRimPlaces) -> Words:
    return f"The rim was crossed at {_count(one.count, 'place')}, {_rim_cause(one)}.", ""


@words_of.register
def _(one: f.OtherRim) -> Words:
    expected = f"{millimetres(one.expected, 3)} (sd {100 * one.fraction:.2g} %)"
    return (
        f"The sensed rim has a radius of {millimetres(one.radius, 3)} and is {millimetres(one.distance)} away from the "
        f"expected place. The expected radius is {expected}, and the sd of the place is {millimetres(one.sd)}."
    ), ""


@words_of.register
def _(one: f.RimSensed) -> Words:
    return f"{_count(one.crossings, 'crossing')} at {_count(one.places, 'place')} of the rim were made.", ""


@words_of.register
def _(one: f.NoTwoRings) -> Words:
    return "The bore is too narrow: beams over its rim do not reach two rings of the wall.", ""


@words_of.register
def _(one: f.FewWallPlaces) -> Words:
    read = f"{one.count} of {_count(one.tried, 'place')}"
    return f"The wall was read at {read}, {millimetres(one.depth)} below the rim.", ""


@words_of.register
def _(one: f.WallSensed) -> Words:
    depths = listed([f"{1e3 * depth:.2g}" for depth in one.depths])
    return f"{_count(one.count, 'place')} of the wall were read, {depths} mm below the rim.", ""


@words_of.register
def _(one: f.EdgesMeet) -> Words:
    return "Two edges meet.", ""


@words_of.register
def _(one: f.EdgesPass) -> Words:
    return f"The two edges pass each other at {millimetres(one.distance)}, {one.sds:.1f} standard deviations.", ""


@words_of.register
def _(one: f.StepFailed) -> Words:
    before = "" if one.before is None else f"{sentence(one.before)} "
    return f"{before}The {one.step} is not acquired. {sentence(one.cause)}", ""


@words_of.register
def _(one: f.AfterMotion) -> Words:
    return f"{sentence(one.result)} The last motion failed. {sentence(one.motion)}", ""
