// Orders to the run, and what the programs answer.
import { encodeControl, type Value } from "./cdr";
import type { Connection } from "./connection";
import { PROGRAMS, type Model } from "./model";

const VERBS = { stop: 0, pause: 1, resume: 2, step: 3, seek: 4, engine: 5, ratio: 8, speed: 9 };
const OUTCOMES = ["preparing", "done", "refused"];
const NO_ANSWER_MS = 5000;
const SURE_MS = 4000;
const MOST_LINES = 30;

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

export class Controls {
  answers = 0;
  /** A program has answered an order of this page. */
  answered?: (number: number) => void;
  private readonly log = element("answers");
  private readonly pauseButton = element<HTMLButtonElement>("pause");
  private readonly stepButton = element<HTMLButtonElement>("step");
  private readonly stopButton = element<HTMLButtonElement>("stop");
  private readonly sent = new Map<number, { text: string; answered: boolean; quiet: boolean }>();
  private sure = 0;

  constructor(private readonly connection: Connection, private readonly model: Model) {
    this.pauseButton.onclick = () => this.togglePause();
    this.stepButton.onclick = () => this.step();
    this.stopButton.onclick = () => this.stop();
    element<HTMLFormElement>("engine").onsubmit = (event) => {
      event.preventDefault();
      const data = new FormData(event.target as HTMLFormElement);
      this.order("engine", `${data.get("target")} ${data.get("name")} ${data.get("preset")}`);
    };
    element<HTMLFormElement>("ratio").onsubmit = (event) => {
      event.preventDefault();
      this.order("ratio", String(new FormData(event.target as HTMLFormElement).get("bounds")).replace(/\s*[–-]\s*/, "-").trim());
    };
  }

  /** A new scene: the ratio can be changed where it adapts. */
  describe(): void {
    const bounds = this.model.settings.get("settings.ratio") ?? "", form = element<HTMLFormElement>("ratio");
    form.hidden = !bounds.includes("-");
    element("ratioBounds").textContent = `within ${bounds.replace("-", "–")}`;
    (form.elements.namedItem("bounds") as HTMLInputElement).placeholder = bounds;
  }

  togglePause(): void {
    this.order(this.model.paused ? "resume" : "pause");
  }

  step(): void {
    this.order("step");
  }

  /** Moves a replay. Returns the number of the order; 0: it was not sent. Its answer is not listed. */
  seek(to_s: number): number {
    return this.order("seek", String(to_s), true);
  }

  setSpeed(speed: string): void {
    this.order("speed", speed);
  }

  /** The first press asks. */
  stop(): void {
    clearTimeout(this.sure);
    if (this.stopButton.classList.toggle("sure")) {
      this.stopButton.querySelector("span")!.textContent = "Stop now?";
      this.sure = setTimeout(() => this.calm(), SURE_MS) as unknown as number;
      return;
    }
    this.calm();
    this.order("stop");
  }

  private calm(): void {
    this.stopButton.classList.remove("sure");
    this.stopButton.querySelector("span")!.textContent = "Stop";
  }

  enable(usable: boolean): void {
    for (const button of document.querySelectorAll<HTMLButtonElement>("[data-order]")) button.disabled = !usable;
  }

  show(): void {
    const paused = this.model.paused;
    this.pauseButton.querySelector("span")!.textContent = paused ? "Resume" : "Pause";
    this.pauseButton.classList.toggle("paused", paused);
    this.pauseButton.title = `${paused ? "Resume" : "Pause"} the world (space)`;
  }

  private order(verb: keyof typeof VERBS, argument = "", quiet = false): number {
    const number = crypto.getRandomValues(new Uint32Array(1))[0];
    const text = `${verb} ${argument}`.trim();
    if (!this.connection.publish(encodeControl(number, VERBS[verb], argument))) {
      this.say("refused", `${text}: not connected`);
      return 0;
    }
    this.sent.set(number, { text, answered: false, quiet });
    setTimeout(() => {
      if (!this.sent.get(number)?.answered && !quiet) this.say("preparing", `${text}: no answer yet; the order stays in force`);
      if (quiet) this.sent.delete(number);
    }, NO_ANSWER_MS);
    return number;
  }

  /** Answers to orders of others are shown too. */
  hear(reply: Value): void {
    const known = this.sent.get(reply.number), outcome = OUTCOMES[reply.outcome] ?? "refused";
    if (known) {
      known.answered = true;
      this.answered?.(reply.number);
    }
    ++this.answers;
    if (PROGRAMS[reply.program] === "world_sim" && outcome === "done") {
      if (reply.text === "resumed") this.model.paused = false;
      if (reply.text === "paused" || reply.text.includes("then paused")) this.model.paused = true;
      this.show();
    }
    if (known?.quiet && outcome === "done") return;
    const program = ["World", "Sub-world", "Device", "Display"][reply.program] ?? "?";
    this.say(outcome, `${program}${reply.program ? ` ${reply.instance}` : ""}: ${reply.text}`);
  }

  say(kind: string, text: string): void {
    const line = document.createElement("li");
    line.className = kind;
    line.textContent = text;
    this.log.prepend(line);
    while (this.log.children.length > MOST_LINES) this.log.lastChild!.remove();
  }
}
