"""What is left of the page's controls: odd addresses, foreign pages."""

import json

import pytest


@pytest.mark.parametrize("junk", ["#cam=1,2", "#cam=nan,0,0,1,0,0&t=x", "#%E0%A4%A", "#show=<b>&speed=1e99&color=,,,",
                                  "#crowd=station&follow=-1"])
def test_addresses_that_make_no_sense_open_all_the_same(page, station, junk):
    page.open(station.page + junk)
    page.wait("document.body.dataset.frame")


def test_a_page_of_another_origin_gets_nothing(browser, station):
    foreign = browser.page()
    foreign.open("data:text/html,<title>foreign</title>")
    address = json.dumps(station.page.replace("http://", "ws://").rstrip("/") + "/ws")
    assert foreign.evaluate(f"""new Promise(resolve => {{
        const socket = new WebSocket({address});
        socket.onopen = () => resolve('open'); socket.onerror = () => resolve('refused'); }})""") == "refused"
    foreign.close()
