// Figures over simulated time.
import uPlot from "uplot";
import { length, PROGRAMS, type Model } from "./model";
import { theme, userColour } from "./theme";

const WINDOW_S = 20;
const DRAW_MS = 120, DRAW_SLOWLY_MS = 500;
const HEIGHT = 118;

type Line = { label: string; colour: string; dash?: number[] };

class Plot {
  private plot?: uPlot;
  private lines: Line[] = [];
  private data: (number | null)[][] = [[]];
  private drawn = 0;
  private stale = true;

  constructor(private readonly root: HTMLElement, private readonly unit: string, private readonly steps = false) {}

  get points(): number {
    return this.data[0].length;
  }

  /** Adds a point; lines that are new begin here. */
  push(x: number, values: Map<string, { value: number; line: Line }>): void {
    const [times] = this.data;
    if (times.length && x < times[times.length - 1]!) this.clear();
    if (times.length && x === times[times.length - 1]) return;
    for (const [, { line }] of values) {
      if (this.lines.some((one) => one.label === line.label)) continue;
      this.lines.push(line);
      this.data.push(new Array(this.data[0].length).fill(null));
      this.remake();
    }
    this.data[0].push(x);
    this.lines.forEach((line, i) => this.data[i + 1].push(values.get(line.label)?.value ?? null));
    const old = this.data[0].findIndex((one) => one! > x - WINDOW_S - 1);
    if (old > 200) for (const column of this.data) column.splice(0, old);
    this.stale = true;
  }

  clear(): void {
    this.lines = [];
    this.data = [[]];
    this.remake();
  }

  remake(): void {
    this.plot?.destroy();
    this.plot = undefined;
    this.stale = true;
  }

  draw(now_ms: number, slowly: boolean): void {
    if (!this.stale || now_ms - this.drawn < (slowly ? DRAW_SLOWLY_MS : DRAW_MS)) return;
    const width = this.root.clientWidth;
    if (width < 50 || !this.lines.length) return;
    this.drawn = now_ms;
    this.stale = false;
    this.plot ??= this.make(width);
    if (this.plot.width !== width) this.plot.setSize({ width, height: HEIGHT });
    this.plot.setData(this.data as uPlot.AlignedData);
    this.showNewest(this.plot);
  }

  /** The newest values in the legend, unless the mouse is in the plot. */
  private showNewest(plot: uPlot): void {
    if ((plot.cursor.left ?? -1) < 0) plot.setLegend({ idx: this.data[0].length - 1 }, false);
  }

  private make(width: number): uPlot {
    const { ink, muted, line } = theme(), font = "11px system-ui, sans-serif";
    const axis = { stroke: muted, font, grid: { stroke: line, width: 1 }, ticks: { stroke: line, size: 4 } };
    const value = (_: uPlot, v: number | null) => (v === null || v === undefined ? "–" : `${short(v)} ${this.unit}`);
    return new uPlot({
      width, height: HEIGHT, padding: [8, 6, 0, 0],
      legend: { live: true }, hooks: { ready: [(plot) => this.showNewest(plot)] }, cursor: { points: { size: 6 }, y: false },
      scales: {
        x: { time: false, range: (_, __, most) => [Math.max(0, most - WINDOW_S), Math.max(WINDOW_S, most)] },
        y: { range: (_, low, high) => around(low, high) },
      },
      axes: [
        { ...axis, size: 22, space: 60, values: (_, splits) => splits.map((one) => `${short(one)} s`) },
        { ...axis, size: 44, space: 26, values: (_, splits) => splits.map(short) },
      ],
      series: [
        { label: "t", value: (_, v) => (v === null || v === undefined ? "–" : `${v.toFixed(2)} s`) },
        ...this.lines.map((one) => ({
          label: one.label, stroke: one.colour || ink, width: one.dash ? 1 : 1.6, dash: one.dash, value,
          points: { show: false }, spanGaps: true,
          paths: this.steps ? uPlot.paths.stepped!({ align: -1 }) : undefined,
        })),
      ],
    }, this.data as uPlot.AlignedData, this.root);
  }
}

function short(value: number): string {
  if (value === 0) return "0";
  return Math.abs(value) >= 100 ? value.toFixed(0) : String(Number(value.toPrecision(3)));
}

function around(low: number | null, high: number | null): [number, number] {
  const from = Math.min(0, low ?? 0), to = Math.max(0, high ?? 0);
  return to - from > 0 ? [from * 1.08, to * 1.08] : [0, 1];
}

const point = (value: number, label: string, colour: string, dash?: number[]) =>
  [label, { value, line: { label, colour, dash } }] as const;

export class Plots {
  readonly force: Plot;
  readonly steps: Plot;
  readonly missed: Plot;
  readonly energy: Plot;
  private readonly reports = new Map<number, any>();

  constructor(private readonly root: HTMLElement) {
    const inside = (name: string) => root.querySelector<HTMLElement>(`[data-plot="${name}"] .plot`)!;
    this.force = new Plot(inside("force"), "N");
    this.steps = new Plot(inside("steps"), "ms");
    this.missed = new Plot(inside("missed"), "/s", true);
    this.energy = new Plot(inside("energy"), "J");
  }

  isOpen(name: string): boolean {
    return this.root.querySelector<HTMLDetailsElement>(`[data-plot="${name}"]`)!.open;
  }

  private get all(): Plot[] {
    return [this.force, this.steps, this.missed, this.energy];
  }

  clear(): void {
    this.reports.clear();
    for (const plot of this.all) plot.clear();
  }

  restyle(): void {
    for (const plot of this.all) plot.remake();
  }

  snapshot(model: Model): void {
    this.force.push(model.time_s, new Map([...model.forces].sort(([a], [b]) => a - b).map(([user, force]) =>
      point(length(force), `user ${user}`, userColour(user)))));
    const reports = [...this.reports.values()];
    if (!reports.length) return;
    this.steps.push(model.time_s, new Map(reports.flatMap((one) => [
      point(1e3 * one.step_mean_s, `user ${one.user} mean`, userColour(one.user)),
      point(1e3 * one.step_max_s, `user ${one.user} max`, userColour(one.user), [4, 3]),
    ])));
    this.energy.push(model.time_s, new Map(reports.flatMap((one) => [
      point(one.operator_work_j, `user ${one.user} operator`, userColour(one.user)),
      point(one.device_work_j, `user ${one.user} device`, userColour(one.user), [6, 4]),
      point(one.coupling_energy_j, `user ${one.user} stored`, userColour(one.user), [2, 3]),
    ])));
  }

  report(report: any): void {
    this.reports.set(report.user, report);
  }

  status(model: Model): void {
    const values = [...model.programs.values()]
      .sort((a, b) => a.status.program - b.status.program || a.status.instance - b.status.instance)
      .filter((one) => PROGRAMS[one.status.program] !== "gui_headless")
      .map((one) => {
        const world = PROGRAMS[one.status.program] === "world_sim", device = PROGRAMS[one.status.program] === "device_sim";
        const label = world ? "world" : `${device ? "device" : "user"} ${one.status.instance}`;
        return point(one.missedPerSecond, label, world ? "" : userColour(one.status.instance), device ? [4, 3] : undefined);
      });
    this.missed.push(model.time_s, new Map(values));
  }

  draw(now_ms: number, slowly: boolean): void {
    for (const plot of this.all) plot.draw(now_ms, slowly);
  }
}
