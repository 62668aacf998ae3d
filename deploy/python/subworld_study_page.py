"""The person of a study at a browser: its instructions, trials and questions as a page. `subworld study FILE --page`."""

import json
import re
import secrets
import threading
import urllib.request
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

HTML = """<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Study</title><style>
:root { color-scheme: light dark } body { font: 1.2rem/1.5 system-ui, sans-serif; max-width: 40rem; margin: 12vh auto; padding: 0 1rem }
#place { opacity: .8; font-size: 1rem } #text { white-space: pre-line; font-size: 1.4rem }
form { display: flex; flex-wrap: wrap; gap: .6rem } button, input { font: inherit; padding: .5rem 1.2rem; min-width: 3rem }
</style><main><p id="place"></p><p id="text" aria-live="polite"></p><form id="answers"></form></main><script>
const at = id => document.getElementById(id);
let shown = -1, world = null, buttons = [];
async function send(number, value) {
  const reply = await fetch('answer', {method: 'POST', body: JSON.stringify({number, value})});
  if (!reply.ok && shown === number) buttons.forEach(b => b.disabled = false);
}
function show(s) {
  shown = s.number; at('place').textContent = s.place; at('text').textContent = s.text;
  if (!s.url && s.kind !== 'wait' && world) { world.close(); world = null; }
  if (s.url && world) world.location = s.url;
  const button = text => {
    const made = document.createElement('button'); made.type = 'button'; made.textContent = text;
    made.onclick = () => { if (s.opens) world = open('', 'world'); buttons.forEach(b => b.disabled = true);
      send(s.number, field ? field.value : text); };
    return made;
  };
  const field = s.from === undefined ? null : document.createElement('input');
  if (field) Object.assign(field, {type: 'number', min: s.from, max: s.to, ariaLabel: s.text});
  buttons = field ? [button('OK')] : (s.answers ?? []).map(button);
  at('answers').replaceChildren(...(field ? [field] : []), ...buttons);
  if (s.url && !world) { const a = document.createElement('a'); a.href = s.url; a.target = 'world';
    a.textContent = 'Open the world'; at('answers').append(a); }
  (field ?? (buttons.length === 1 ? buttons[0] : null))?.focus();  // no answer is favoured
}
at('answers').onsubmit = event => { event.preventDefault(); buttons[0].click(); };
onkeydown = event => { if (event.target.tagName !== 'INPUT') buttons[event.key - 1]?.click(); };
(async () => { for (;;) {
  try { show(await (await fetch('state?' + shown)).json()); }
  catch { at('place').textContent = 'The study is over or has stopped. The same command goes on.'; at('answers').replaceChildren();
          await new Promise(resolve => setTimeout(resolve, 1000)); shown = -1; } } })();
</script>"""
MOST_BUTTONS = 12  # a longer scale is a field


def serves(address: str) -> bool:
    try:
        with urllib.request.urlopen(address, timeout=1):
            return True
    except OSError:
        return False


class Page:
    """Serves the page on this machine, to whoever knows its `address`. It shows one thing at a time, also after a reload."""

    def __init__(self, port: int = 0):
        self._changed = threading.Condition()
        self._state, self._accepts, self._answer = {"number": 0, "kind": "wait", "place": "", "text": "Please wait."}, [], None
        path = f"/{secrets.token_urlsafe(16)}/"
        page = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def handle(self):
                try:
                    super().handle()
                except ConnectionError:  # the browser has left, as at each reload
                    pass

            def reply(self, code: int, kind: str = "text/plain", text: str = ""):
                body = text.encode()
                self.send_response(code)
                for name, value in {"Content-Type": f"{kind}; charset=utf-8", "Content-Length": len(body),
                                    "Cache-Control": "no-store", "Content-Security-Policy":
                                    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
                                    "connect-src 'self'; base-uri 'none'; frame-ancestors 'none'"}.items():
                    self.send_header(name, str(value))
                self.end_headers()
                self.wfile.write(body)

            def do_GET(self):
                if self.path == path:
                    self.reply(200, "text/html", HTML)
                elif seen := re.fullmatch(re.escape(path) + r"state\?(-?\d{1,9})", self.path):
                    self.reply(200, "application/json", json.dumps(page.state_after(int(seen[1]))))
                else:
                    self.reply(404)

            def do_POST(self):
                size = self.headers.get("Content-Length", "")
                if self.path != path + "answer" or not size.isdigit() or int(size) > 10000:
                    self.close_connection = True
                    return self.reply(404)
                try:
                    came = json.loads(self.rfile.read(int(size)))
                    taken = page.take(came["number"], came["value"])
                except (ValueError, TypeError, KeyError, RecursionError):
                    taken = False
                return self.reply(200 if taken else 409)

            def log_message(self, *_):
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        self.address = f"http://127.0.0.1:{self._server.server_port}{path}"

    def state_after(self, number: int) -> dict:
        """The state, once it is another one than that which a browser has; at the latest after 20 s."""
        with self._changed:
            self._changed.wait_for(lambda: self._state["number"] != number, 20)
            return self._state

    def take(self, number: int, value) -> bool:
        with self._changed:
            if number != self._state["number"] or value not in self._accepts or self._answer is not None:
                return False
            self._answer = value
            self._changed.notify_all()
            return True

    def _show(self, text: str, kind: str, accepts=(), **more):
        with self._changed:
            self._state = {"number": self._state["number"] + 1, "kind": kind, "place": self.place, "text": text, **more}
            self._accepts, self._answer = list(accepts), None
            self._changed.notify_all()

    def _answered(self) -> str:
        with self._changed:
            while self._answer is None:
                self._changed.wait(0.5)  # with an end, so that a signal is seen
            return self._answer

    # What `subworld_study.conduct` asks of a person.
    place = ""

    def confirm(self, text: str):
        self._show(text, "confirm", ["Go on"], answers=["Go on"])
        self._answered()

    def begin(self, number: int, count: int, opens: bool):
        """`opens`: the run has a page, which opens in a window of its own: browsers permit that after a click."""
        self.place = f"Trial {number + 1} of {count}"
        self._show("Are you ready?", "confirm", ["Begin"], answers=["Begin"], opens=opens)
        self._answered()

    def watch(self, run):
        """Until the run has ended."""
        self._show("The trial runs.", "wait")
        address = None
        while run.running:
            found = re.search(r"^subworld: page: (\S+)", run.log, re.MULTILINE)
            if found and not address and serves(found[1]):
                address = found[1]
                self._show("The trial runs.", "wait", url=address)
            threading.Event().wait(0.05)

    def ask(self, question: dict) -> str:
        answers = question.get("answers") or range(question["from"], question["to"] + 1)
        answers = [str(one) for one in answers]
        more = {"answers": answers} if len(answers) <= MOST_BUTTONS else {"from": answers[0], "to": answers[-1]}
        self._show(question["text"], "question", answers, **more)
        return self._answered()

    def over(self):
        self.place = ""
        self._show("The study is over. Thank you.", "over")
        threading.Event().wait(1)  # so that the browser has it
