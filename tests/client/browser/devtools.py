"""A headless Chromium, driven over the DevTools protocol."""

import base64
import itertools
import json
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time
import urllib.request

import websocket

FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-proxy-server",
         "--hide-scrollbars", "--mute-audio", "--remote-debugging-port=0", "--remote-allow-origins=*")
DEADLINE_S = 90  # only bounds how long a broken page hangs


def find_chromium():
    return shutil.which("chromium") or shutil.which("chromium-browser")


class Browser:
    """One browser with a profile of its own; `page` opens tabs."""

    def __init__(self):
        self.profile = tempfile.TemporaryDirectory(prefix="throng-chromium-", ignore_cleanup_errors=True)
        self.process = subprocess.Popen(
            [find_chromium(), *FLAGS, f"--user-data-dir={self.profile.name}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        port_file = pathlib.Path(self.profile.name) / "DevToolsActivePort"
        until(lambda: port_file.exists() and port_file.read_text().count("\n") >= 1, "the browser has no port")
        self.port = int(port_file.read_text().split("\n")[0])

    def page(self, width=1280, height=800, scale=1, mobile=False):
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}/json/new?about:blank", method="PUT")
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with opener.open(request, timeout=DEADLINE_S) as answer:
            target = json.load(answer)
        return Page(target["webSocketDebuggerUrl"], width, height, scale, mobile)

    def close(self):
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.profile.cleanup()


class Page:
    """One tab. What it logs as an error or throws is kept in `errors`."""

    def __init__(self, url, width, height, scale, mobile):
        self.socket = websocket.create_connection(url, timeout=DEADLINE_S, suppress_origin=True, http_no_proxy="*",
                                                  skip_utf8_validation=True)  # of megabytes, in Python
        self.ids = itertools.count(1)
        self.errors = []
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.resize(width, height, scale, mobile)

    def call(self, method, **parameters):
        number = next(self.ids)
        self.socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self.socket.recv())
            if message.get("id") == number:
                assert "error" not in message, (method, message)
                return message["result"]
            self.note(message)

    def note(self, message):
        parameters = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        if message.get("method") == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
            self.errors.append(" ".join(str(one.get("value", one.get("description"))) for one in parameters["args"]))
        if message.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(parameters["entry"]["text"])

    def resize(self, width, height, scale=1, mobile=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale,
                  mobile=mobile)
        self.call("Emulation.setTouchEmulationEnabled", enabled=mobile)

    def open(self, url):
        self.call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete'")

    def show(self):
        """Brings the tab to the front; others are hidden then."""
        self.call("Page.bringToFront")

    def evaluate(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def wait(self, expression, seconds=DEADLINE_S):
        """Waits until an expression is true, and returns it."""
        return until(lambda: self.evaluate(expression), f"never true: {expression}", seconds)

    def screenshot(self, path=None):
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        if path:
            pathlib.Path(path).write_bytes(data)
        return data

    # Names of keys that are more than their character.
    KEYS = {" ": "Space", "Escape": "Escape", "Home": "Home", "End": "End", "ArrowLeft": "ArrowLeft",
            "ArrowRight": "ArrowRight", "ArrowUp": "ArrowUp", "ArrowDown": "ArrowDown", "Tab": "Tab", "Enter": "Enter"}

    def key_down(self, key):
        text = {"text": key} if len(key) == 1 else {"text": "\r", "windowsVirtualKeyCode": 13} if key == "Enter" else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, code=self.KEYS.get(key, f"Key{key.upper()}"), **text)

    def key_up(self, key):
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, code=self.KEYS.get(key, f"Key{key.upper()}"))

    def press(self, key):
        self.key_down(key)
        self.key_up(key)

    def mouse(self, kind, x, y, button="left", **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=1, **more)

    def click(self, x, y):
        self.mouse("mouseMoved", x, y, "none")
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    def drag(self, x, y, to_x, to_y, button="left", steps=6):
        buttons = {"left": 1, "right": 2, "middle": 4}[button]
        self.mouse("mouseMoved", x, y, "none")
        self.mouse("mousePressed", x, y, button, buttons=buttons)
        for step in range(1, steps + 1):
            t = step / steps
            self.mouse("mouseMoved", x + (to_x - x) * t, y + (to_y - y) * t, button, buttons=buttons)
        self.mouse("mouseReleased", to_x, to_y, button)

    def wheel(self, x, y, delta):
        self.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=delta)

    def touch(self, kind, *points):
        self.call("Input.dispatchTouchEvent", type=kind,
                  touchPoints=[{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)])

    def click_on(self, selector):
        """Clicks in the middle of an element, as a hand would."""
        x, y = self.evaluate(f"""(() => {{
            const box = document.querySelector({json.dumps(selector)}).getBoundingClientRect();
            return [box.x + box.width / 2, box.y + box.height / 2]; }})()""")
        self.click(x, y)

    def close(self):
        try:
            self.call("Page.close")
        except websocket.WebSocketConnectionClosedException:
            pass  # it closed before it could say so
        self.socket.close()


def until(condition, complaint, seconds=DEADLINE_S):
    """Waits for something outside this process."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.03)
    raise AssertionError(complaint)
