"""Who gets in, and how the program starts and ends."""

import json
import re
import socket
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

pytest.importorskip("websockets", minversion="13", reason='the view needs ".[view]"')
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from mecanum_env.view.server import FIRST_PORT, HOST, Server


@pytest.fixture
def server():
    server = Server(hello={"type": "hello", "mode": "drive"})
    yield server
    server.close()


def live(server, origin=None):
    address = server.url.replace("http", "ws") + "live"
    return connect(address, origin=origin or f"http://{HOST}:{server.port}", open_timeout=20)


def status_of(url):
    try:
        with urllib.request.urlopen(url, timeout=20) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


@pytest.mark.parametrize("name", ["", "style.css", "page.js", "drive.js", "plots.js"])
def test_the_page_is_served(server, name):
    assert status_of(server.url + name) == 200


@pytest.mark.parametrize("path", ["", "wrong/", "page.js", "..%2f/page.js", "live"])
def test_nothing_is_served_without_the_word_in_the_address(server, path):
    assert status_of(f"http://{HOST}:{server.port}/{path}") == 404


def test_no_other_file_is_served(server):
    assert status_of(server.url + "../server.py") == 404


def test_every_start_has_another_word():
    servers = [Server(), Server()]
    words = {server.url.split("/")[3] for server in servers}
    for server in servers:
        server.close()
    assert len(words) == 2
    assert min(map(len, words)) >= 22


def test_a_page_from_elsewhere_cannot_connect(server):
    with pytest.raises(InvalidStatus, match="403"):
        live(server, origin="http://example.org")


def test_no_other_machine_can_connect(server):
    assert server._listening.getsockname()[0] == "127.0.0.1"


def test_a_page_is_greeted_and_heard(server):
    with live(server) as page:
        assert json.loads(page.recv(timeout=20)) == server.hello
        page.send('{"type": "reset"}')
        heard = []
        while not heard:
            heard = list(server.messages())
    assert heard == [{"type": "reset"}]


@pytest.mark.parametrize(
    "text", ["no json", "[" * 3000, '{"type": 3}', "[1]", b"\x00", '"' + "x" * 5000 + '"']
)
def test_what_no_page_sends_ends_the_connection_alone(server, text):
    with live(server) as page:
        page.recv(timeout=20)
        page.send(text)
        with pytest.raises(ConnectionClosed):
            page.recv(timeout=20)
    with live(server) as page:
        assert json.loads(page.recv(timeout=20)) == server.hello


def test_a_page_that_sees_no_pictures_gets_no_more_than_two(server):
    with live(server) as page:
        page.recv(timeout=20)
        for i in range(5):
            server.publish({"type": "note", "text": str(i)}, b"picture")
            received = page.recv(timeout=20)
        pictures = 0
        while (received := page.recv(timeout=20)) != '{"type": "note", "text": "4"}':
            pictures += isinstance(received, bytes)
        assert pictures <= 2
        assert not server.wants_picture


def test_a_second_one_takes_another_port(server):
    other = Server()
    other.close()
    assert other.port != server.port
    assert other.port > FIRST_PORT


def test_a_port_that_is_taken_is_refused_in_one_sentence():
    with socket.create_server((HOST, 0)) as taken:
        command = [sys.executable, "-m", "mecanum_env.view", "--port", str(taken.getsockname()[1])]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert done.stderr.startswith("error: port ")
    assert done.stderr.count("\n") == 1


def test_ctrl_c_ends_it_without_a_traceback(start_view):
    view = start_view()
    with connect(view.url.replace("http", "ws") + "live", origin=view.url.rsplit("/", 2)[0]) as page:
        page.recv(timeout=20)
        assert view.interrupt() == (0, "")


def test_without_its_library_the_view_says_what_to_install():
    program = (
        "import sys; sys.modules['websockets'] = None; sys.argv = ['view', '--no-browser']; "
        "from mecanum_env.cli import run; from mecanum_env.view.__main__ import view; sys.exit(run(view))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert done.returncode > 1
    assert re.fullmatch(r"error: the view needs websockets 13 or newer: `pip install .*\n", done.stderr)


def test_a_connection_through_which_nothing_was_asked_is_closed_with_the_server() -> None:
    server = Server()
    with socket.create_connection((HOST, server.port), timeout=5.0) as silent:
        # The first one has been accepted once the second one is answered.
        with urllib.request.urlopen(server.url, timeout=5.0) as answer:
            assert answer.status == 200
        server.close()
        assert silent.recv(1) == b""
