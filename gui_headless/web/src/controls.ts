// Orders to the run, and what the programs answer.
import { encodeControl, type Value } from "./cdr";
import type { Connection } from "./connection";
import { PROGRAMS, type Model } from "./model";

const VERBS = { stop: 0, pause: 1, resume: 2, step: 3, set_engine: 5 };
const OUTCOMES = ["preparing", "done", "refused"];
const NO_ANSWER_MS = 5000;
const SURE_MS = 4000;
const MOST_LINES = 30;

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

export class Controls {
  answers = 0;
  private readonly log = element("answers");
  private readonly pauseButton = element<HTMLButtonElement>("pause");
  private readonly stepButton = element<HTMLButtonElement>("step");
  private readonly stopButton = element<HTMLButtonElement>("stop");
  private readonly sent = new Map<number, { text: string; answered: boolean }>();
  private sure = 0;

  constructor(private readonly connection: Connection, private readonly model: Model) {
    this.pauseButton.onclick = () => this.togglePause();
    this.stepButton.onclick = () => this.step();
    this.stopButton.onclick = () => this.stop();
    element<HTMLFormElement>("engine").onsubmit = (event) => {
      event.preventDefault();
      const data = new FormData(event.target as HTMLFormElement);
      this.order("set_engine", `${data.get("target")} ${data.get("name")} ${data.get("preset")}`);
    };
  }

  togglePause(): void {
    this.order(this.model.paused ? "resume" : "pause");
  }

  step(): void {
    this.order("step");
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

  private order(verb: keyof typeof VERBS, argument = ""): void {
    const number = crypto.getRandomValues(new Uint32Array(1))[0];
    const text = argument ? `engine ${argument}` : verb;
    if (!this.connection.publish(encodeControl(number, VERBS[verb], argument))) return this.say("refused", `${text}: not connected`);
    this.sent.set(number, { text, answered: false });
    setTimeout(() => {
      if (!this.sent.get(number)?.answered) this.say("preparing", `${text}: no answer yet; the order stays in force`);
    }, NO_ANSWER_MS);
  }

  /** Answers to orders of others are shown too. */
  hear(reply: Value): void {
    const known = this.sent.get(reply.number), outcome = OUTCOMES[reply.outcome] ?? "refused";
    if (known) known.answered = true;
    ++this.answers;
    if (PROGRAMS[reply.program] === "world_sim" && outcome === "done") {
      if (reply.text === "resumed") this.model.paused = false;
      if (reply.text === "paused" || reply.text.includes("then paused")) this.model.paused = true;
      this.show();
    }
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
