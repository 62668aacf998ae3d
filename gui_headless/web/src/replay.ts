// The bar of a replay: its moment, its speed, play and step.
import type { Controls } from "./controls";
import { PROGRAMS, type Model } from "./model";

const NO_ANSWER_MS = 500; // then the newest wanted moment is sent all the same
const END_S = 0.05; // of the end
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

export class Replay {
  private readonly bar = element("replay");
  private readonly slider = element<HTMLInputElement>("moment");
  private readonly speed = element<HTMLSelectElement>("speed");
  private readonly playButton = element<HTMLButtonElement>("play");
  private from_s = 0;
  private to_s = 0;
  private wanted_s?: number; // not yet asked for
  private asked = { number: 0, at: 0 }; // the order that is under way; 0: none
  private dragged = false;

  constructor(private readonly controls: Controls, private readonly model: Model) {
    this.playButton.onclick = () => this.play();
    element<HTMLButtonElement>("stepReplay").onclick = () => controls.step();
    this.speed.onchange = () => controls.setSpeed(this.speed.value);
    this.slider.oninput = () => {
      this.dragged = true;
      this.seek(Number(this.slider.value));
    };
    this.slider.onchange = () => (this.dragged = false);
    this.slider.onkeydown = (event) => this.key(event);
    controls.answered = (number) => this.answered(number);
    setInterval(() => this.ask(), 100);
  }

  /** Whether what is shown is a recording. */
  get active(): boolean {
    return !this.bar.hidden;
  }

  /** A new scene. */
  describe(): void {
    const { settings } = this.model;
    this.bar.hidden = !settings.has("replay.to_s");
    document.body.classList.toggle("replay", this.active);
    this.from_s = Number(settings.get("replay.from_s") ?? 0);
    this.to_s = Number(settings.get("replay.to_s") ?? 0);
    Object.assign(this.slider, { min: String(this.from_s), max: String(this.to_s), step: "any", value: String(this.from_s) });
    this.wanted_s = undefined;
    this.asked.number = 0;
    this.show();
  }

  /** New data. */
  show(): void {
    if (!this.active) return;
    const { model } = this, busy = this.dragged || this.asked.number !== 0 || this.wanted_s !== undefined;
    if (!busy) this.slider.value = String(model.time_s);
    const now = `${Number(this.slider.value).toFixed(2)} of ${this.to_s.toFixed(2)} s`;
    element("momentText").textContent = now;
    this.slider.setAttribute("aria-valuetext", now);
    this.playButton.classList.toggle("paused", model.paused);
    this.playButton.setAttribute("aria-label", model.paused ? "Play" : "Pause");
    this.playButton.title = `${model.paused ? "Play" : "Pause"} (space)`;
  }

  /** The world's status has the speed. */
  showSpeed(): void {
    const world = this.model.programs.get(`${PROGRAMS.indexOf("world_sim")}/0`);
    const speed = String(Number((world?.status.real_time_factor ?? 1).toPrecision(3)));
    if (!this.active || document.activeElement === this.speed || this.speed.value === speed) return;
    const options = [...new Set([...SPEEDS, Number(speed)])].sort((a, b) => a - b).map((one) => new Option(`${one} ×`, String(one)));
    this.speed.replaceChildren(...options);
    this.speed.value = speed;
  }

  /** At the end it begins again. */
  play(): void {
    if (this.model.paused && this.model.time_s > this.to_s - END_S) this.seek(this.from_s);
    this.controls.togglePause();
  }

  private key(event: KeyboardEvent): void {
    const steps: Record<string, number> = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
    if (event.key === " ") this.play();
    else if (steps[event.key]) {
      const to_s = Number(this.slider.value) + (steps[event.key] * (this.to_s - this.from_s)) / 100;
      this.slider.value = String(to_s);
      this.seek(Number(this.slider.value));
    } else return;
    event.preventDefault();
  }

  private seek(to_s: number): void {
    this.wanted_s = to_s;
    this.ask();
    this.show();
  }

  /** One order at a time: while it is under way, only the newest moment waits. */
  private ask(): void {
    if (this.asked.number && performance.now() - this.asked.at > NO_ANSWER_MS) this.asked.number = 0;
    if (this.wanted_s === undefined || this.asked.number) return;
    this.asked = { number: this.controls.seek(this.wanted_s), at: performance.now() };
    this.wanted_s = undefined;
  }

  private answered(number: number): void {
    if (number !== this.asked.number) return;
    this.asked.number = 0;
    this.ask();
  }
}
