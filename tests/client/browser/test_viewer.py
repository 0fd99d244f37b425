"""The page in a real browser: what a viewer sees and does."""

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


def hash_of(page):
    text = page.evaluate("location.hash").lstrip("#")
    return dict(part.split("=", 1) for part in text.split("&")) if text else {}


def test_the_only_crowd_opens_by_itself_and_moves(page):
    assert page.evaluate("document.getElementById('crowd-name').textContent") == "station"
    width, height, colors = page.evaluate(PIXELS)
    assert (width, height) == (1280, 800)
    assert colors > 40, "a picture of people has many colours"
    first = page.evaluate(FRAME)
    page.wait(f"{FRAME} > {first} + 5")
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
    page.wait("document.getElementById('live').getAttribute('aria-pressed') === 'false'")
    page.wait(f"{FRAME} > {page.evaluate(FRAME)} + 6")  # what was on its way
    there = page.evaluate("document.getElementById('time').textContent")
    newest = page.evaluate(NEWEST)
    page.wait(f"{NEWEST} > {newest} + 0.5")
    assert page.evaluate("document.getElementById('time').textContent") == there
    assert other.evaluate("document.getElementById('live').getAttribute('aria-pressed')") == "true"
    page.press("l")
    page.wait("document.getElementById('live').getAttribute('aria-pressed') === 'true'")
    other.close()
