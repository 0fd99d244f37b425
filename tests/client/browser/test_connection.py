"""Several crowds, none, tokens, and a server that goes away."""

import http.server
import threading
import urllib.request

import devtools
import pytest
from conftest import Producer, Server


@pytest.fixture
def own_server():
    servers = []

    def make(*arguments, **places):
        servers.append(Server(*arguments, **places))
        return servers[-1]

    yield make
    for server in servers:
        if server.process.poll() is None:
            server.stop()


def metrics(server):
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(server.page.split("#")[0] + "metrics", timeout=10) as answer:
        return answer.read().decode()


@pytest.fixture
def tab(browser):
    opened = browser.page()
    yield opened
    opened.close()


def test_waits_for_a_crowd_then_lets_choose(tab, own_server, walk_file):
    server = own_server()
    tab.open(server.page)
    tab.wait("document.getElementById('start-text').textContent.includes('No crowd yet')")
    # Both at once, so that there is a choice.
    producers = [Producer(server, walk_file, name) for name in ("hall", "square")]
    tab.wait("document.body.dataset.frame || document.querySelectorAll('#start-list .crowd').length === 2")
    if tab.evaluate("!document.body.dataset.frame"):
        tab.click_on("#start-list [data-crowd=square]")
        tab.wait("document.getElementById('crowd-name').textContent === 'square'")
    else:  # the first was there alone for a moment
        tab.click_on("#crowd-button")
        tab.wait("!!document.querySelector('#crowd-list [data-crowd=square]')")
        tab.click_on("#crowd-list [data-crowd=square]")
    tab.wait("document.getElementById('crowd-name').textContent === 'square' && document.body.dataset.frame")
    assert tab.evaluate("document.getElementById('start').hidden")
    for producer in producers:
        producer.stop()
    assert tab.errors == []


def test_comes_back_by_itself_after_a_restart(tab, own_server, walk_file):
    server = own_server()
    producer = Producer(server, walk_file, "hall")
    tab.open(server.page)
    tab.wait("document.body.dataset.frame")
    tab.drag(640, 400, 700, 420)
    tab.wait("location.hash.includes('cam=')")
    link = tab.evaluate("location.hash")
    http = server.page.removeprefix("http://").rstrip("/")
    producer.stop()
    server.stop()
    tab.wait("!document.getElementById('banner').hidden")
    again = own_server(http=http)
    producer = Producer(again, walk_file, "hall")
    tab.wait("document.getElementById('banner').hidden")
    tab.evaluate("delete document.body.dataset.frame")
    tab.wait("document.body.dataset.frame")
    assert tab.evaluate("location.hash") == link, "the view is the same"
    producer.stop()
    # That the server did not answer is all there is to tell.
    assert [error for error in tab.errors if "WebSocket" not in error] == []


def test_an_unknown_crowd_is_named_with_those_there_are(tab, own_server, walk_file):
    server = own_server()
    tab.open(server.page + "#crowd=nosuch")
    tab.wait("document.getElementById('start-text').textContent.includes(\"no crowd 'nosuch' here\")")
    assert "no other is here" in tab.evaluate("document.getElementById('start-text').textContent")
    producer = Producer(server, walk_file, "hall")
    tab.wait("!!document.querySelector('#start-list [data-crowd=hall]')")
    assert "these are here" in tab.evaluate("document.getElementById('start-text').textContent")
    late = Producer(server, walk_file, "nosuch")
    tab.wait("document.getElementById('crowd-name').textContent === 'nosuch' && document.body.dataset.frame")
    assert tab.evaluate("document.getElementById('start').hidden")
    # The same by a changed address.
    tab.evaluate("location.hash = '#crowd=nothing'")
    tab.wait("!document.getElementById('start').hidden && "
             "document.getElementById('start-text').textContent.includes(\"no crowd 'nothing' here\")")
    devtools.until(lambda: "\nthrong_viewers 0\n" in metrics(server), "the old picture still comes")
    tab.click_on("#start-list [data-crowd=hall]")
    tab.wait("document.getElementById('crowd-name').textContent === 'hall' && document.getElementById('start').hidden")
    for one in (producer, late):
        one.stop()
    assert tab.errors == []


def test_says_what_it_waits_for_until_the_first_picture(tab, own_server, walk_file):
    server = own_server()
    tab.call("Page.addScriptToEvaluateOnNewDocument", source="""
        window.said = [];
        new MutationObserver(() => {
            const line = document.getElementById('waiting');
            if (line && !line.hidden) said.push(line.textContent);
        }).observe(document, {subtree: true, childList: true, attributes: true, characterData: true});""")
    producer = Producer(server, walk_file, "hall")
    tab.open(server.page)
    tab.wait("document.body.dataset.frame")
    tab.wait("document.getElementById('waiting').hidden")
    said = tab.evaluate("said")
    assert any(line.startswith("Connecting to 127.0.0.1:") for line in said), said
    assert any(line.startswith("Waiting for the first ") and "'hall'" in line for line in said), said
    producer.stop()
    assert tab.errors == []


def test_asks_for_a_token(tab, own_server, walk_file, tmp_path):
    (tmp_path / "tokens").write_text("0123456789abcdef\n")
    server = own_server("--token-file", str(tmp_path / "tokens"))
    tab.open(server.page)
    tab.wait("!document.getElementById('token-form').hidden")
    for token, words in (("not the right one", "not known"), ("0123456789abcdef", "No crowd yet")):
        tab.evaluate(f"document.getElementById('token').value = '{token}'")
        tab.click_on("#token-form button")
        tab.wait(f"document.getElementById('start-text').textContent.includes('{words}')")
    assert tab.errors == []


def test_a_page_of_this_machine_may_show_it_in_a_frame(tab, own_server, walk_file):
    """What throng.show(URL) gives a notebook, which has an address of its own."""
    server = own_server()
    producer = Producer(server, walk_file, "hall")

    class Notebook(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(f'<iframe src="{server.page}" width="800" height="500"></iframe>'.encode())

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Notebook) as notebook:
        threading.Thread(target=notebook.serve_forever, daemon=True).start()
        tab.open(f"http://localhost:{notebook.server_port}/")
        # It is another site's: what it does is seen in the server's numbers.
        devtools.until(lambda: 'throng_crowd_viewers{crowd="hall"} 1\n' in metrics(server), "nobody watches in the frame")
        notebook.shutdown()
    producer.stop()
    assert tab.errors == []
