// The programs of the run, who serves whom, and how each is doing.
import { PROGRAMS, type Model, type Program } from "./model";
import { userColour } from "./theme";

const ABSENT_MS = 3500;

type Health = "good" | "late" | "absent" | "waiting";

const ROLES: Record<string, string> = { world_sim: "World", haptic_sim: "Sub-world", device_sim: "Device", gui_headless: "Display" };

function healthOf(program: Program | undefined, now_ms: number): Health {
  if (!program || now_ms - program.at > ABSENT_MS) return "absent";
  if (program.status.waits_for || !["running", "stopping"].includes(program.status.state)) return "waiting";
  return program.missedPerSecond > 0 ? "late" : "good";
}

const WORDS: Record<Health, string> = { good: "in time", late: "misses deadlines", absent: "absent", waiting: "waiting" };

function milliseconds(seconds: number): string {
  return `${Number((1e3 * seconds).toPrecision(3))} ms`;
}

export class Programs {
  constructor(private readonly root: HTMLElement) {}

  show(model: Model, now_ms: number): void {
    const h_s = Number(model.settings.get("settings.h_s")) || 0;
    const find = (kind: string, instance: number) => model.programs.get(`${PROGRAMS.indexOf(kind)}/${instance}`);
    const rows: HTMLElement[] = [this.card("world_sim", find("world_sim", 0), 0, now_ms, 0)];
    for (let user = 0; user < model.userCount; ++user) {
      const pair = document.createElement("div");
      pair.className = "pair";
      pair.style.setProperty("--user", userColour(user));
      pair.append(this.card("haptic_sim", find("haptic_sim", user), user, now_ms, h_s),
        this.card("device_sim", find("device_sim", user), user, now_ms, h_s));
      rows.push(pair);
    }
    const display = find("gui_headless", 0);
    if (display) rows.push(this.card("gui_headless", display, 0, now_ms, 0));
    this.root.replaceChildren(...rows);
  }

  private card(kind: string, program: Program | undefined, instance: number, now_ms: number, deadline_s: number): HTMLElement {
    const card = document.createElement("div"), health = healthOf(program, now_ms), status = program?.status;
    card.className = `program ${health}`;
    const own = kind === "haptic_sim" || kind === "device_sim" ? ` ${instance}` : "";
    const add = (parent: HTMLElement, tag: string, text: string, name = "") => {
      const one = document.createElement(tag);
      one.textContent = text;
      one.className = name;
      parent.append(one);
      return one;
    };
    const head = add(card, "div", "", "head");
    add(head, "strong", `${ROLES[kind]}${own}`);
    const absent_s = program ? Math.round((now_ms - program.at) / 1000) : 0;
    let state = health === "good" && status.state !== "running" ? status.state : WORDS[health];
    if (health === "absent" && program) state = `absent for ${absent_s} s`;
    if (health === "waiting") state = status.waits_for ? `waits for ${status.waits_for}` : status.state;
    if (kind === "world_sim" && status?.paused && health !== "absent") state = "paused";
    add(head, "span", state, "state");
    const facts: [string, string][] = [];
    if (status && health !== "absent") {
      if (kind !== "gui_headless") {
        facts.push(["rate", `${status.rate_hz.toFixed(status.rate_hz < 10 ? 1 : 0)} Hz`]);
        facts.push(["step", milliseconds(status.step_s)]);
        if (deadline_s > 0) facts.push(["deadline", milliseconds(deadline_s)]);
        const byOs = Number(status.missed_by_os);
        facts.push(["missed", `${program!.missed}${byOs ? ` (${byOs} OS)` : ""}`]);
      }
      if (Number(status.lost)) facts.push(["lost", String(status.lost)]);
      if (Number(status.refused)) facts.push(["refused", String(status.refused)]);
    }
    if (facts.length) {
      const list = add(card, "dl", "");
      for (const [name, value] of facts) {
        const cell = add(list, "div", "");
        add(cell, "dt", name);
        add(cell, "dd", value);
      }
    }
    if (status?.text && health !== "absent") add(card, "p", status.text, "note");
    return card;
  }
}
