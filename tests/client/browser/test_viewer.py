"""The page in a real browser: what a viewer sees and does."""

import base64
import json
import math
import struct

import devtools
import pytest

PIXELS = """(() => {
    const canvas = document.getElementById('picture'), counts = new Map();
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    for (let i = 0; i < data.length; i += 4 * 97) {
        const key = (data[i] >> 4) << 8 | (data[i + 1] >> 4) << 4 | data[i + 2] >> 4;
        counts.set(key, (counts.get(key) || 0) + 1);
    }
    return [canvas.width, canvas.height, counts.size]; })()"""
NEWEST = "Number(document.getElementById('timeline').getAttribute('aria-valuemax'))"
FRAME = "Number(document.body.dataset.frame)"


def more_frames(page, count):
    """Waits until as many more were shown: what was on its way is there then."""
    page.wait(f"{FRAME} > {page.evaluate(FRAME)} + {count}")


def shows_time(page, text):
    page.wait(f"document.getElementById('time').textContent === '{text}'")


def is_live(page, pressed):
    page.wait(f"document.getElementById('live').getAttribute('aria-pressed') === '{pressed}'")


def kept_picture(page):
    """Keeps what is on the canvas; gives an expression: how many pixels are others now."""
    page.evaluate("""(() => {
        const canvas = document.getElementById('picture');
        const pixels = () => new Uint32Array(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.buffer);
        const kept = pixels();
        window.changedPixels = () => { const now = pixels(); let n = 0;
            for (let i = 0; i < now.length; i++) n += now[i] !== kept[i]; return n; };
        })()""")
    return "changedPixels()"


def hash_of(page):
    text = page.evaluate("location.hash").lstrip("#")
    return dict(part.split("=", 1) for part in text.split("&")) if text else {}


def test_the_only_crowd_opens_by_itself_and_moves(page):
    assert page.evaluate("document.getElementById('crowd-name').textContent") == "station"
    width, height, colors = page.evaluate(PIXELS)
    assert (width, height) == (1280, 800)
    assert colors > 40, "a picture of people has many colours"
    more_frames(page, 5)
    assert page.wait("document.getElementById('crowd-count').textContent") == "30 people"


def test_dragging_turns_the_camera_and_the_address_remembers(page):
    before = hash_of(page)
    assert "cam" not in before, "an overview needs no camera"
    page.drag(640, 400, 800, 440)
    page.wait("location.hash.includes('cam=')")
    yaw, pitch = map(float, hash_of(page)["cam"].split(",")[4:6])
    assert abs(yaw + 90) > 20 and pitch > 36


def test_keys_reach_the_overlays_and_the_help(page):
    for key in "gbk":
        page.press(key)
    page.wait("location.hash.includes('show=grid,scale,time')")
    page.press("?")
    assert page.wait("document.getElementById('help').open")
    page.press("Escape")
    page.wait("!document.getElementById('help').open")


def test_space_pauses_this_viewer_alone(page, browser, station):
    other = browser.page()
    other.open(station.page)
    other.wait("document.body.dataset.frame")
    page.show()
    page.press(" ")
    page.wait("document.getElementById('play').getAttribute('aria-label') === 'Play'")
    is_live(page, "false")
    more_frames(page, 6)  # what was on its way
    there = page.evaluate("document.getElementById('time').textContent")
    newest = page.evaluate(NEWEST)
    page.wait(f"{NEWEST} > {newest} + 0.5")
    assert page.evaluate("document.getElementById('time').textContent") == there
    assert other.evaluate("document.getElementById('live').getAttribute('aria-pressed')") == "true"
    page.press("l")
    is_live(page, "true")
    other.close()


def text(page, element):
    return page.evaluate(f"document.getElementById({json.dumps(element)}).textContent")


def open_at(page, station, link):
    """Opens a link in a tab that has shown another one."""
    page.open("about:blank")
    page.open(f"{station.page}#{link}")
    page.wait("document.body.dataset.frame")


def at_scene_time(page, station, seconds):
    """Waits until the history reaches there."""
    page.wait(f"{NEWEST} > {seconds}")
    assert seconds > 0


# The view from above at 5 s: 8.284 m over 800 pixels, the origin in the middle.
FROM_ABOVE = "crowd=station&cam=0,0,0,10,-90,90,ortho&t=5"
PX_PER_M = 800 / (2 * 10 * math.tan(math.radians(22.5)))


def agent_one(seconds):
    """Where walkers() has agent 1, in pixels of that view."""
    angle = 0.3 * seconds
    return 640 + 2 * math.cos(angle) * PX_PER_M, 400 - 2 * math.sin(angle) * PX_PER_M


def test_a_link_brings_back_camera_time_colours_and_overlays(page, station):
    at_scene_time(page, station, 6)
    link = "crowd=station&cam=1,2,0,15,-60,30&t=3.2&color=speed,0,3&show=grid,time"
    open_at(page, station, link)
    shows_time(page, "0:03.2")
    assert page.evaluate("document.getElementById('play').getAttribute('aria-label')") == "Play"
    assert page.evaluate("document.getElementById('channel').value") == "speed"
    assert page.evaluate("document.querySelector('#overlays [value=grid]').checked")
    page.press("b")
    page.wait("location.hash.includes('show=grid,scale,time')")
    assert hash_of(page) == {"crowd": "station", "cam": "1,2,0,15,-60,30", "t": "3.2", "color": "speed,0,3",
                             "show": "grid,scale,time"}


def test_steps_go_one_frame_of_the_producer_both_ways(page, station):
    at_scene_time(page, station, 6)
    open_at(page, station, "crowd=station&t=3")
    shows_time(page, "0:03.0")
    for key, time in ((".", "0:03.1"), (".", "0:03.2"), (",", "0:03.1"), (",", "0:03.0"), (",", "0:02.9")):
        page.press(key)
        shows_time(page, time)


def test_the_time_line_seeks_and_its_live_edge_returns(page, station):
    at_scene_time(page, station, 3)
    box = page.evaluate("(() => { const b = document.getElementById('timeline').getBoundingClientRect(); "
                        "return [b.x, b.y + b.height / 2, b.width]; })()")
    page.click(box[0] + 2, box[1])
    is_live(page, "false")
    page.wait("document.getElementById('time').textContent.startsWith('0:0')")
    page.click_on("#live")
    is_live(page, "true")


def test_playing_backwards_goes_back(page, station):
    at_scene_time(page, station, 6)
    open_at(page, station, "crowd=station&t=5")
    shows_time(page, "0:05.0")
    page.evaluate("(() => { const s = document.getElementById('speed'); s.value = '-1'; s.dispatchEvent(new Event('change')); })()")
    page.press(" ")
    page.wait("Number(document.getElementById('timeline').getAttribute('aria-valuenow')) < 4")


def test_a_click_follows_the_agent_and_escape_lets_go(page, station):
    at_scene_time(page, station, 6)
    open_at(page, station, FROM_ABOVE)
    shows_time(page, "0:05.0")
    page.click(*agent_one(5))
    page.wait("!document.getElementById('agent').hidden")
    assert text(page, "agent-title") == "Agent 1"
    page.wait("location.hash.includes('follow=1')")
    assert "0.6" in text(page, "agent-values"), "walks at 0.6 m/s"
    # The camera goes along: played on, the target is another place.
    before = hash_of(page)["cam"]
    page.press(" ")
    more_frames(page, 8)
    page.press(" ")
    page.press("b")
    page.wait(f"!location.hash.includes({json.dumps(before)})")
    page.press("Escape")
    page.wait("!location.hash.includes('follow')")
    assert page.evaluate("document.getElementById('agent').hidden")


def test_an_unknown_agent_is_not_followed_and_the_view_stays(page, station):
    at_scene_time(page, station, 6)
    open_at(page, station, "crowd=station&cam=0,0,0,20,-90,30&t=3&follow=777")
    page.wait("[...document.querySelectorAll('.toast.bad')].some(one => "
              "one.textContent === \"No agent 777 in 'station' at this time: nobody is followed\")")
    page.wait("!location.hash.includes('follow')")
    assert hash_of(page)["cam"] == "0,0,0,20,-90,30"
    camera = page.evaluate("throngView.header.camera.target")
    assert abs(camera.get("x", 0)) < 1e-6 and abs(camera.get("y", 0)) < 1e-6


def test_a_click_beside_everybody_follows_nobody(page, station):
    at_scene_time(page, station, 6)
    open_at(page, station, FROM_ABOVE)
    page.click(640, 400)
    more_frames(page, 5)
    assert page.evaluate("document.getElementById('agent').hidden")


def test_the_wheel_zooms_to_the_pointer(page, station):
    open_at(page, station, "crowd=station&cam=0,0,0,20,-90,90,ortho")
    page.wheel(900, 300, -400)
    page.wait("!location.hash.includes('cam=0,0,0,20,')")
    x, y, _, distance = map(float, hash_of(page)["cam"].split(",")[:4])
    meters = 2 * 20 * math.tan(math.radians(22.5)) / 800
    pointer = (260 * meters, 100 * meters)
    factor = distance / 20
    assert factor < 0.8
    # What is under the pointer stays there.
    assert abs(x - pointer[0] * (1 - factor)) < 0.02 and abs(y - pointer[1] * (1 - factor)) < 0.02


def test_flying_panning_and_views_move_the_camera(page, station):
    open_at(page, station, "crowd=station&cam=0,0,0,20,-90,30")

    def moved_by(act):
        before = page.evaluate("location.hash")
        act()
        page.wait(f"location.hash !== {json.dumps(before)}")
        return [float(field) for field in hash_of(page)["cam"].split(",")[:6]]

    def hold(key):
        page.key_down(key)
        more_frames(page, 3)
        page.key_up(key)

    assert moved_by(lambda: hold("w"))[1] > 0.1
    assert moved_by(lambda: hold("e"))[2] > 0.05
    assert moved_by(lambda: page.drag(640, 500, 740, 500, "right"))[0] < -0.5
    pitched = moved_by(lambda: page.press("t"))
    page.wait("location.hash.includes('ortho')")
    assert pitched is not None and page.evaluate("document.getElementById('top-down').getAttribute('aria-pressed')") == "true"
    page.press("t")
    page.wait("!location.hash.includes('ortho')")
    page.press("f")
    page.wait("!location.hash.includes('cam=')")


def test_colours_overlays_and_their_legend_are_drawn(page, station):
    at_scene_time(page, station, 6)
    open_at(page, station, "crowd=station&cam=0,0,0,20,-90,30&t=5")
    shows_time(page, "0:05.0")
    page.press("c")
    page.wait("/color=speed,0,[^2]/.test(location.hash)")
    low, high = map(float, hash_of(page)["color"].split(",")[1:])
    assert low == 0 and 2.5 < high < 8, "the range of the people in view"
    for key, value in (("low", "1"), ("high", "3")):
        changed = kept_picture(page)
        page.evaluate(f"(() => {{ const i = document.getElementById('{key}'); i.value = '{value}'; "
                      "i.dispatchEvent(new Event('change')); })()")
        page.wait(f"{changed} > 500")
    page.wait("location.hash.includes('color=speed,1,3')")
    changed = kept_picture(page)
    page.evaluate("(() => { const s = document.getElementById('color-map'); s.value = 'plasma'; "
                  "s.dispatchEvent(new Event('change')); })()")
    page.wait("location.hash.includes('map=plasma')")
    page.wait(f"{changed} > 3000")  # the legend alone is fewer
    open_at(page, station, "crowd=station&cam=0,0,0,20,-90,30&t=5&color=speed,1,3&map=cividis")
    assert page.evaluate("document.getElementById('color-map').value") == "cividis"


@pytest.mark.parametrize("key, name, least", [("g", "grid", 5000), ("i", "ids", 500), ("m", "density", 5000),
                                              ("b", "scale", 200), ("k", "time", 500), ("v", "trails", 500)])
def test_each_overlay_changes_the_picture_and_leaves_it_again(page, station, key, name, least):
    at_scene_time(page, station, 6)
    open_at(page, station, "crowd=station&cam=0,0,0,20,-90,30&t=4")
    shows_time(page, "0:04.0")
    if name == "trails":  # are drawn of what was seen meanwhile
        page.press(key)
        page.press(" ")
        page.wait("Number(document.getElementById('timeline').getAttribute('aria-valuenow')) > 4.6")
        page.press(" ")
        more_frames(page, 8)  # what was on its way
        changed = kept_picture(page)
        page.press(key)
        page.wait(f"{changed} > {least}")
        return
    changed = kept_picture(page)
    assert page.evaluate(changed) == 0, "at rest the picture is the same"
    page.press(key)
    page.wait(f"location.hash.includes('{name}')")
    page.wait(f"{changed} > {least}")
    page.press(key)
    page.wait(f"{changed} === 0")


def test_speed_is_chosen_by_keys_and_kept_in_the_address(page, station):
    at_scene_time(page, station, 6)
    open_at(page, station, "crowd=station&t=1")
    shows_time(page, "0:01.0")
    for _ in range(2):
        page.press("]")
    assert page.evaluate("document.getElementById('speed').value") == "4"
    page.wait("location.hash.includes('speed=4')")
    page.wait("throngView.header.playback.speed === 4")
    page.press(" ")
    page.wait("Number(document.getElementById('timeline').getAttribute('aria-valuenow')) > 3")
    open_at(page, station, "crowd=station&t=1&speed=0.25")
    page.wait("throngView.header.playback.speed === 0.25")
    assert page.evaluate("document.getElementById('speed').value") == "0.25"


def test_a_picture_is_saved(page, tmp_path):
    page.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    page.press("p")
    png = devtools.until(lambda: list(tmp_path.glob("station-*.png")), "no picture")[0]
    devtools.until(lambda: png.read_bytes()[-8:-4] == b"IEND", "the picture has no end")
    assert png.read_bytes()[16:24] == struct.pack(">II", 1280, 800), "as large as the canvas"


def test_a_recording_is_saved(page, tmp_path):
    page.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    page.press("r")
    # An encoder on a busy machine takes its time for the first picture.
    page.wait("/ (0\\.[1-9]|[1-9]).* MB/.test(document.getElementById('record-time').textContent)")
    assert page.evaluate("document.getElementById('record').getAttribute('aria-pressed')") == "true"
    page.press("r")
    video = devtools.until(lambda: list(tmp_path.glob("station-*.webm")), "no video")[0]
    devtools.until(lambda: video.stat().st_size > 1000, "the video is empty")
    assert video.read_bytes()[:4] == b"\x1a\x45\xdf\xa3"
    encoded = base64.b64encode(video.read_bytes()).decode()
    assert page.evaluate(f"""new Promise((resolve, reject) => {{
        const video = document.createElement('video');
        video.onloadeddata = () => resolve([video.videoWidth, video.videoHeight]);
        video.onerror = () => reject(new Error(video.error.message));
        video.src = URL.createObjectURL(new Blob([Uint8Array.from(atob('{encoded}'), c => c.charCodeAt(0))]));
        }})""") == [1280, 800], "the browser plays it"


def test_numbers_are_shown(page):
    page.press("x")
    page.wait("document.getElementById('stats-rows').textContent.includes('Latency')")
    page.wait("/Latency, median[0-9.]+ ms/.test(document.getElementById('stats-rows').textContent)")
    rows = text(page, "stats-rows")
    for words in ("Agents30", "Rasterizer", "Frames per second", "Skipped by the server", "Left out here", "of 40 k",
                  "Detailas budgeted", "Samples a pixel4"):
        assert words in rows


def test_on_a_phone_everything_is_within_reach(browser, station):
    phone = browser.page(390, 844, 2, True)
    phone.open(station.page)
    phone.wait("document.body.dataset.frame")
    assert phone.evaluate("document.documentElement.scrollWidth") == 390
    outside = """[...document.querySelectorAll('button, select, #timeline')].filter(one => one.offsetParent !== null)
        .filter(one => { const b = one.getBoundingClientRect();
                         return b.left < 0 || b.top < 0 || b.right > 390 || b.bottom > 844; }).map(one => one.id)"""
    assert phone.evaluate(outside) == []
    phone.click_on("#display-button")
    phone.wait("!document.getElementById('display').hidden")
    assert phone.evaluate(outside) == []
    phone.click_on("#display-button")
    phone.touch("touchStart", (200, 300))
    for step in range(1, 6):
        phone.touch("touchMove", (200 + 20 * step, 300))
    phone.touch("touchEnd")
    phone.wait("location.hash.includes('cam=')")
    turned = float(hash_of(phone)["cam"].split(",")[4])
    assert abs(turned + 90) > 15
    distance = float(hash_of(phone)["cam"].split(",")[3])
    phone.touch("touchStart", (150, 400), (250, 400))
    for step in range(1, 6):
        phone.touch("touchMove", (150 - 15 * step, 400), (250 + 15 * step, 400))
    phone.touch("touchEnd")
    phone.wait(f"Number(location.hash.split('cam=')[1].split(',')[3]) < {distance} * 0.7")
    errors = list(phone.errors)
    phone.close()
    assert errors == []


def test_by_keyboard_alone(page, station):
    seen = []
    for _ in range(24):
        page.press("Tab")
        seen.append(page.evaluate("document.activeElement.id"))
    for control in ("crowd-button", "fit", "display-button", "help-button", "play", "timeline", "live", "speed"):
        assert control in seen
    page.evaluate("document.getElementById('crowd-button').focus()")
    page.press("Enter")
    page.wait("!document.getElementById('crowd-list').hidden")
    page.wait("document.activeElement.dataset.crowd === 'station'")
    page.press("Escape")
    page.wait("document.getElementById('crowd-list').hidden")
