"""A page from elsewhere can neither read the live page nor drive its session."""

from __future__ import annotations

import http.client
from contextlib import closing, suppress
from importlib.metadata import version

import numpy as np
import pytest

pytest.importorskip("viser", reason="the extra tanteo[viewer] is not installed")
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

EVIL = "http://evil.example"


@pytest.fixture(scope="module")
def address():
    from tanteo.render.live.page import LivePage

    page = LivePage(0, np.zeros(3), 0.1)
    yield page.url.removeprefix("http://")
    page.stop()


def status(address, **headers):
    with closing(http.client.HTTPConnection(address, timeout=10)) as connection:
        connection.request("GET", "/", headers=headers)
        return connection.getresponse().status


def opened(address, **options):
    """Return whether its socket accepts a connection."""
    protocol = f"viser-v{version('viser')}"
    with suppress(InvalidStatus), connect(f"ws://{address}", subprotocols=[protocol], open_timeout=10, **options):
        return True
    return False


def test_its_own_page_is_served(address):
    assert status(address) == 200
    assert status(address, Origin=f"http://{address}") == 200
    assert opened(address, origin=f"http://{address}")


@pytest.mark.parametrize("origin", [EVIL, "null", "http://127.0.0.1:1", "http://[", "https://127.0.0.1.evil.example"])
def test_a_foreign_origin_is_refused(address, origin):
    assert status(address, Origin=origin) == 403
    assert not opened(address, origin=origin)


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8080", "127.0.0.1.evil.example", "[", ""])
def test_a_foreign_host_is_refused(address, host):
    assert status(address, Host=host) == 403


@pytest.mark.parametrize("host", ["localhost:9000", "127.0.0.1:8471", "[::1]:8080"])
def test_a_tunnel_may_have_another_port(address, host):
    assert status(address, Host=host, Origin=f"http://{host}") == 200
    assert status(address, Host=host, Origin="http://localhost:3000") == 403
