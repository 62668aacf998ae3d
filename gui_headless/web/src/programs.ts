// The programs of the run, who serves whom, and how each is doing.
import { ABSENT_MS, PROGRAMS, type Model, type Place, type Program } from "./model";
import { userColour } from "./theme";

type Health = "good" | "late" | "absent" | "waiting";

const ROLES: Record<string, string> = { world_sim: "World", haptic_sim: "Sub-world", device_sim: "Device", gui_headless: "Display" };

function healthOf(program: Program | undefined, now_ms: number): Health {
  if (!program || now_ms - program.at > ABSENT_MS) return "absent";
  if (program.status.waits_for || !["running", "stopping"].includes(program.status.state)) return "waiting";
  return program.missedPerSecond > 0 ? "late" : "good";
}

const VENDORS: Record<string, string> = { fastdds: "Fast DDS", cyclonedds: "Cyclone DDS" };

/** The time in which the programs must have made a step, s, of the world and of the others; 0: there is none. */
function deadlines(settings: Map<string, string>): { world: string; other: string } {
  if (settings.get("settings.mode") !== "realtime") return { world: "", other: "" };
  const h_s = Number(settings.get("settings.h_s")) || 0;
  const ratios = (settings.get("settings.ratio") ?? "").split("-").map(Number).filter((one) => one > 0);
  return { world: ratios.map((one) => milliseconds(one * h_s)).join(" to "), other: h_s > 0 ? milliseconds(h_s) : "" };
}

const WORDS: Record<Health, string> = { good: "in time", late: "misses deadlines", absent: "absent", waiting: "waiting" };

function milliseconds(seconds: number): string {
  return `${Number((1e3 * seconds).toPrecision(3))} ms`;
}

const SLOWLY_MS = 1000; // a machine that draws by software needs as long for texts as for bodies

export class Programs {
  private shown_ms = 0;

  constructor(private readonly root: HTMLElement) {}

  show(model: Model, now_ms: number, slowly: boolean): void {
    if (slowly && now_ms - this.shown_ms < SLOWLY_MS) return;
    this.shown_ms = now_ms;
    const due = deadlines(model.settings), replay = model.settings.has("replay.to_s");
    const card = (kind: string, instance: number, deadline: string) => {
      const key = `${PROGRAMS.indexOf(kind)}/${instance}`;
      // The programs of a recording are no more where they were.
      return this.card(kind, model.programs.get(key), replay ? undefined : model.places.get(key), instance, now_ms, deadline);
    };
    const rows: HTMLElement[] = [card("world_sim", 0, due.world)];
    for (let user = 0; user < model.userCount; ++user) {
      const pair = document.createElement("div");
      pair.className = "pair";
      pair.style.setProperty("--user", userColour(user));
      pair.append(card("haptic_sim", user, due.other), card("device_sim", user, due.other));
      rows.push(pair);
    }
    if (model.programs.has(`${PROGRAMS.indexOf("gui_headless")}/0`)) rows.push(card("gui_headless", 0, ""));
    this.root.replaceChildren(...rows);
  }

  private card(kind: string, program: Program | undefined, place: Place | undefined, instance: number, now_ms: number,
    deadline: string): HTMLElement {
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
        if (deadline) facts.push(["deadline", deadline]);
        const byOs = Number(status.missed_by_os);
        facts.push(["missed", `${program!.missed}${byOs ? ` (${byOs} OS)` : ""}`]);
      }
      if (Number(status.lost)) facts.push(["lost", String(status.lost)]);
      if (Number(status.refused)) facts.push(["refused", String(status.refused)]);
    }
    if (program?.absences) facts.push(["absences", `${program.absences}, ${Math.round(program.absent_ms / 1000)} s in all`]);
    if (place) {
      facts.push(["DDS", VENDORS[place.dds] ?? (place.dds || "–")]);
      facts.push(["host", place.host || "–"]);
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
