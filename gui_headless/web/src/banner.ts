// The line above the scene: the page is cut off, or the run has ended, with its verdict.
import type { Link } from "./connection";
import { type Gate, type Model, PROGRAMS } from "./model";

const NEXT = "The page shows the next run that is served here.";
const READABLE: Record<string, [number, string]> = { s: [1e3, " ms"], ratio: [100, " %"], "1": [1, ""] };

function figure(value: number, unit: string): string {
  const [scale, text] = READABLE[unit] ?? [1, ` ${unit}`];
  return `${Number((scale * value).toPrecision(4))}${text}`;
}

function effect(gate: Gate): string {
  if (!gate.warning) return "missed";
  return gate.missed_by === "scene" ? "warning" : "remark";
}

/** What the page itself has counted. */
function facts(model: Model): string {
  const loops = [...model.programs.values()].filter((one) => PROGRAMS[one.status.program] !== "gui_headless");
  const missed = loops.reduce((sum, one) => sum + one.missed, 0);
  return `${model.time_s.toFixed(1)} s simulated, ${missed} missed deadlines in all.`;
}

export class Banner {
  private shown = "";

  constructor(private readonly root: HTMLElement) {}

  show(link: Link, detail: string, model: Model): void {
    const verdict = model.verdict;
    const [title, more] = verdict ? ["The run has ended.", facts(model)] : {
      connecting: ["", ""], live: ["", ""],
      frozen: [`No data for ${detail}.`, "The display or the network stands still. What you see is old."],
      lost: ["Connection lost.", "What you see is old. The page connects again by itself."],
      ended: ["The run has ended.", `${facts(model)} The verdict is in the terminal and in summary.json. ${NEXT}`],
    }[link];
    // What is shown already is not read out again.
    const text = title + more + (verdict?.verdict ?? "");
    if (text === this.shown) return;
    this.shown = text;
    this.root.hidden = !title;
    this.root.className = verdict ? `verdict ${this.kind(verdict.verdict)}` : link;
    const line = document.createElement("span");
    line.textContent = more;
    this.root.replaceChildren(title, line);
    if (verdict) this.root.append(...this.judgement(model));
  }

  private kind(verdict: string): string {
    if (verdict.startsWith("ok")) return "good";
    return verdict.startsWith("stopped") && !verdict.includes("until then") ? "stopped" : "bad";
  }

  private judgement(model: Model): HTMLElement[] {
    const { verdict, gates } = model.verdict!;
    const say = (name: string, ...content: (string | Node)[]) => {
      const element = document.createElement(name);
      element.append(...content);
      return element;
    };
    const lines = [say("p", say("b", "Verdict: "), verdict)];
    const missed = gates.filter((gate) => !gate.ok).sort((a, b) => Number(a.warning) - Number(b.warning));
    if (missed.length > 0) {
      const list = say("ul", ...missed.map((gate) => {
        const bound = `${gate.at_most ? "at most" : "at least"} ${figure(gate.bound, gate.unit)}`;
        const why = verdict.includes(gate.why) ? "" : `: ${gate.why}`;
        const item = say("li", say("b", `${gate.name} ${figure(gate.value, gate.unit)}`), `, ${bound}: ${effect(gate)}${why}`);
        item.className = effect(gate);
        return item;
      }));
      list.tabIndex = 0; // scrolls by keyboard
      list.setAttribute("aria-label", "Quality gates that are not ok");
      lines.push(list);
    }
    const count = gates.length > 0 ? `${gates.length - missed.length} of ${gates.length} quality gates ok. ` : "";
    lines.push(say("p", `${count}All figures are in summary.json. ${NEXT}`));
    return lines;
  }
}
