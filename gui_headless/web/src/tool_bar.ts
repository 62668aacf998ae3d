// The bar with the tools that this page can hold, and the force on the one that it holds.
import { Deflections } from "./touch/deflection";
import { length } from "./model";
import { Pad } from "./touch/pad";
import { Sound } from "./sound";
import { SpaceMouse } from "./touch/space_mouse";
import { forceColour, Spring } from "./touch/spring";
import type { Touch } from "./touch/touch";
import { userColour } from "./theme";
import type { View } from "./view";
import * as THREE from "three";

const FULL_N = 20; // of the colours and of the meter

const make = <K extends keyof HTMLElementTagNameMap>(tag: K, parent: HTMLElement, name: string, text = "") => {
  const one = document.createElement(tag);
  one.className = name;
  one.textContent = text;
  parent.append(one);
  return one;
};

export class ToolBar {
  private readonly root = document.createElement("div");
  private readonly row: HTMLElement;
  private readonly meter: HTMLElement;
  private readonly level: HTMLElement;
  private readonly value: HTMLElement;
  private readonly note: HTMLElement;
  private readonly chooser: HTMLButtonElement;
  private readonly device: HTMLElement;
  private readonly sound = new Sound();
  private readonly pad = new Pad();
  private readonly spaceMouse = new SpaceMouse(() => this.show());
  private readonly spring = new Spring();
  private shown = "";
  private said = 0;

  constructor(stage: HTMLElement, private readonly touch: Touch, private readonly view: View, private readonly users: () => number) {
    this.root.id = "tools";
    this.root.className = "floating";
    this.root.setAttribute("role", "group");
    this.root.setAttribute("aria-label", "Tools");
    this.root.hidden = true;
    this.row = make("div", this.root, "row");
    this.meter = make("div", this.root, "force");
    this.value = make("output", this.meter, "value");
    this.value.setAttribute("aria-label", "force");
    this.level = make("span", make("span", this.meter, "scale"), "level");
    const button = make("button", this.meter, "sound", "Sound");
    button.title = "Pitch and volume follow the force";
    button.setAttribute("aria-pressed", "false");
    button.onclick = () => button.setAttribute("aria-pressed", String(this.sound.toggle()));
    this.chooser = make("button", this.meter, "chooser", "SpaceMouse");
    this.chooser.title = "Choose a SpaceMouse that moves the tool";
    this.chooser.onclick = () => this.spaceMouse.ask();
    this.device = make("p", this.root, "device");
    this.device.setAttribute("role", "status");
    this.note = make("p", this.root, "note");
    this.note.setAttribute("role", "status");
    stage.after(this.root);
    view.add(this.spring.root);
    view.drawn = () => this.draw();
    const deflections = new Deflections(touch, view, () => [...this.pad.read(), ...this.spaceMouse.read()]);
    touch.moved = (passed_s) => deflections.move(passed_s);
    this.show();
  }

  /** The tools, or who holds them, have changed. */
  show(): void {
    const { tools, user } = this.touch, { wanted, said } = this.spaceMouse;
    const shown = JSON.stringify([tools, user, this.touch.holds, this.users(), wanted, said]);
    if (shown === this.shown) return;
    this.shown = shown;
    const focused = this.root.contains(document.activeElement);
    this.root.hidden = tools.length === 0;
    this.row.replaceChildren(...tools.map((one) => {
      const button = document.createElement("button"), mine = one.user === user;
      const whose = this.users() > 1 ? ` of user ${one.user}` : "";
      button.dataset.user = String(one.user);
      button.style.setProperty("--user", userColour(one.user));
      button.textContent = mine ? `Release the tool${whose}` : one.holder ? `Another page holds the tool${whose}` : `Take the tool${whose}`;
      button.disabled = !mine && one.holder !== 0;
      button.setAttribute("aria-pressed", String(mine));
      button.onclick = () => (mine ? this.touch.release() : this.touch.take(one.user));
      return button;
    }));
    if (!wanted && document.activeElement === this.chooser) this.touch.focus();
    this.chooser.hidden = !wanted;
    this.device.textContent = said;
    this.device.hidden = user < 0 || said === "";
    if (focused && user < 0) this.row.querySelector<HTMLButtonElement>("button:not(:disabled)")?.focus();
    this.meter.hidden = user < 0;
    this.note.hidden = user < 0;
    this.note.textContent = user < 0 ? ""
      : matchMedia("(pointer: coarse)").matches ? "Drag with one finger. Two fingers turn the camera."
      : "Drag in the view. Wheel or Shift: away and near. Arrows, Page Up, Page Down. Right drag turns the camera. Esc releases.";
    if (user < 0) {
      this.sound.play(0);
      this.spring.hide();
      this.view.touch();
    }
  }

  /** With each picture. */
  private draw(): void {
    const proxy = this.touch.user < 0 ? undefined : this.touch.proxy(), device = new THREE.Vector3();
    if (proxy === undefined || !this.touch.place(device)) return this.spring.hide();
    const force_n = length(this.touch.force), part = force_n / FULL_N;
    this.spring.show(this.view.bodies.position(proxy, new THREE.Vector3()), device, 0.2 * this.view.size_m(), part);
    this.level.style.width = `${Math.min(100, 100 * part).toFixed(1)}%`;
    this.level.style.background = `#${forceColour(part).getHexString()}`;
    this.sound.play(part);
    this.pad.shake(part);
    const now = performance.now();
    if (now - this.said < 100) return; // a number that changes faster cannot be read
    this.said = now;
    this.value.textContent = `${force_n.toFixed(1)} N`;
  }
}
