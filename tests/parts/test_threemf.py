"""3MF files: what is built of them, and what is damaged or made to fill the memory."""

import time
import zipfile
from contextlib import suppress

import numpy as np
import pytest

from tanteo.errors import PartError
from tanteo.parts import read_part

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELATION = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"


def mesh(a=60, b=40, c=20):
    corners = [(x, y, z) for x in (0, a) for y in (0, b) for z in (0, c)]
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in corners)
    triangles = "".join(f'<triangle v1="{i}" v2="{j}" v3="{k}"/>' for i, j, k in faces)
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"


def model(resources, build, more='unit="millimeter"'):
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><model {more} xmlns="{CORE}" xmlns:p="{PRODUCTION}">'
        f"<resources>{resources}</resources><build>{build}</build></model>"
    )


def write(tmp_path, text, root="3D/3dmodel.model", **others):
    path = tmp_path / "part.3mf"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        rels = f'<Relationships xmlns="r"><Relationship Target="/{root}" Type="{RELATION}"/></Relationships>'
        file.writestr("_rels/.rels", rels)
        file.writestr(root, text)
        for name, content in others.items():
            file.writestr(f"3D/{name}.model", content)
    return path


def sides(part):
    return np.round(1e3 * np.ptp(part.box, axis=0), 6).tolist()


def test_an_undeclared_prefix_harms_no_mesh(tmp_path):
    resources = f'<ms:metal name="m" x:ness="1"/><object id="1">{mesh()}</object>'
    part = read_part(write(tmp_path, model(resources, '<item objectid="1"/>')))
    assert sides(part) == [60, 40, 20]
    with pytest.raises(PartError, match="a damaged one"):
        read_part(write(tmp_path, model(resources, '<item objectid="1">')))


def test_only_what_is_built_and_supports_nothing_is_the_part(tmp_path):
    resources = (
        f'<object id="1" type="model">{mesh()}</object><object id="2" type="support">{mesh(200, 40, 30)}</object>'
    )
    resources += f'<object id="3">{mesh(500, 5, 5)}</object>'
    part = read_part(write(tmp_path, model(resources, '<item objectid="1"/><item objectid="2"/>')))
    assert sides(part) == [60, 40, 20]
    assert part.repairs == ("Excluded 1 object of the type support.",)
    part = read_part(write(tmp_path, model(f'<object id="1">{mesh()}</object>', "")))
    assert part.repairs == ("The file builds nothing: all its objects are taken.",)


def test_components_are_placed_and_mirrored(tmp_path):
    resources = f'<object id="1">{mesh()}</object><object id="2"><components><component objectid="1"/>'
    resources += '<component objectid="1" transform="-1 0 0 0 1 0 0 0 1 300 0 0"/></components></object>'
    build = '<item objectid="2" transform="0 1 0 -1 0 0 0 0 1 5 0 0"/>'
    part = read_part(write(tmp_path, model(resources, build, 'unit="centimeter"')))
    assert part.unit == "cm"
    assert sides(part) == [400, 3000, 200]
    assert part.volume == pytest.approx(2 * 0.6 * 0.4 * 0.2)


def test_objects_in_other_files_of_the_package_are_read(tmp_path):
    other = model(f'<object id="7">{mesh()}</object>', "", 'unit="inch"')
    build = '<item objectid="7" p:path="/3D/other.model"/>'
    part = read_part(write(tmp_path, model("", build, 'unit="millimeter" requiredextensions="p"'), other=other))
    assert sides(part) == [60 * 25.4, 40 * 25.4, 20 * 25.4]
    assert part.unit == "mm"
    resources = '<object id="1"><components><component objectid="7" p:path="/3D/other.model"/></components></object>'
    part = read_part(write(tmp_path, model(resources, '<item objectid="1"/>'), root="model.model", other=other))
    assert part.volume == pytest.approx(60 * 40 * 20 * 0.0254**3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (model("", "")[:-30], "expected XML in the 3MF file, got a damaged one"),
        (model("", '<item objectid="4"/>'), "expected an object 4 in 3D/3dmodel.model, got none"),
        (model("", '<item objectid="4" p:path="/3D/gone.model"/>'), "expected a file '3D/gone.model' in the archive"),
        (model("", "<item/>"), "expected the attribute 'objectid'"),
        (model('<object id="1"><mesh/></object>', '<item objectid="1"/>'), "got an empty mesh"),
        (model(f'<object id="1">{mesh("x")}</object>', '<item objectid="1"/>'), "expected numbers in the 3MF mesh"),
        (model(f'<object id="1">{mesh()}</object>'.replace('v3="7"', 'v3="9"'), ""), "corner indices below 8"),
        (
            model(f'<object id="1">{mesh()}</object>', '<item objectid="1" transform="1 2"/>'),
            "12 numbers of a transform",
        ),
        (model("", "", 'unit="league"'), "expected one of the units micron, millimeter"),
        (model("", "", 'xmlns:b="urn:beams" requiredextensions="b"'), "needs the 3MF extension 'urn:beams'"),
        ("<!DOCTYPE m [<!ENTITY a 'b'>]><model>&a;</model>", "got XML with a document type"),
        (
            model('<object id="1"><components><component objectid="1"/></components></object>', '<item objectid="1"/>'),
            "got object 1 made of itself",
        ),
    ],
)
def test_a_3mf_file_that_is_wrong_is_refused_in_a_sentence(tmp_path, text, message):
    with pytest.raises(PartError, match=rf"part\.3mf: .*{message}"):
        read_part(write(tmp_path, text))


def test_damaged_archives_are_refused(tmp_path):
    path = write(tmp_path, model(f'<object id="1">{mesh()}</object>', '<item objectid="1"/>'))
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for at in rng.integers(0, len(whole), 60):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 85]) + whole[at + 1 :])
        with suppress(PartError):  # and nothing else; some bytes do not matter
            read_part(path)
    for kept in (10, len(whole) // 2, len(whole) - 8):
        path.write_bytes(whole[:kept])
        with pytest.raises(PartError, match=r"part\.3mf: expected"):
            read_part(path)


def test_an_archive_that_unpacks_to_very_much_is_refused_soon(tmp_path):
    path = tmp_path / "part.3mf"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file, file.open("3D/3dmodel.model", "w") as stream:
        for _ in range(40):
            stream.write(bytes(1 << 20))
    began = time.process_time()
    with pytest.raises(PartError, match=r"an archive of [\d,]+ bytes that unpacks to more than"):
        read_part(path)
    assert time.process_time() - began < 2
    packed = path.read_bytes()  # an archive that understates what it holds
    path.write_bytes(packed.replace((40 << 20).to_bytes(4, "little"), (100).to_bytes(4, "little")))
    with pytest.raises(PartError, match=r"part\.3mf: expected"):
        read_part(path)


def test_copies_of_copies_come_to_an_end(tmp_path):
    resources = f'<object id="0">{mesh()}</object>'
    for k in range(1, 12):
        parts = f'<component objectid="{k - 1}"/>' * 10
        resources += f'<object id="{k}"><components>{parts}</components></object>'
    began = time.process_time()
    with pytest.raises(PartError, match="expected up to 20000 copies"):
        read_part(write(tmp_path, model(resources, '<item objectid="11"/>')))
    assert time.process_time() - began < 2
