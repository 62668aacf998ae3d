// Wires the page: what arrives goes into the model, and from there into the view, the plots and the lists.
import { Banner } from "./banner";
import { Connection, type Link } from "./connection";
import { Controls } from "./controls";
import { niceBelow } from "./arrows";
import { length, Model, PROGRAMS, SHAPES } from "./model";
import { Plots } from "./plots";
import { Programs } from "./programs";
import { Replay } from "./replay";
import { followTheme, JOINT, userColour } from "./theme";
import { ToolBar } from "./tool_bar";
import { Touch } from "./touch/touch";
import { View } from "./view";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const model = new Model();
const view = new View(element<HTMLCanvasElement>("view"), model);
const plots = new Plots(element("panel"));
const programs = new Programs(element("programs"));
const banner = new Banner(element("banner"));
let link: Link = "connecting";
let linkDetail = "";
let fits = 0;

const connection = new Connection(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${location.pathname}${location.search}`, {
  started() {
    model.programs.clear();
    model.places.clear();
    model.devices.clear();
    model.forces.clear();
    model.users = [];
    model.verdict = undefined;
    plots.clear();
    showLink();
  },
  linked(now, detail) {
    link = now;
    linkDetail = detail;
    document.body.dataset.link = link;
    controls.enable(link === "live");
    if (link === "lost" || link === "ended") touch.lost();
    showLink();
    if (link === "live") subscribe();
  },
  received(topic, value) {
    const now = performance.now();
    if (topic === "/scene") {
      model.describe(value);
      view.build();
      describe();
      toolBar.show();
    } else if (topic === "/joints") {
      view.joints.build(value.marks);
      element("jointLayer").hidden = value.marks.length === 0;
      element("jointSwatch").style.background = JOINT;
      view.touch();
    } else if (topic === "/world_view") {
      model.show(value, now);
      view.update();
      plots.snapshot(model);
      replay.show();
      if (fits < 2) fit();
    } else if (topic === "/status") {
      model.hear(value, now);
      if (PROGRAMS[value.program] === "world_sim") plots.status(model);
      controls.show();
      replay.show();
      replay.showSpeed();
      showLink();
    } else if (topic === "/program_place") {
      model.placeProgram(value);
    } else if (topic === "/verdict") {
      model.verdict = value;
      showLink();
    } else if (topic === "/control_reply") {
      controls.hear(value);
      replay.show();
      showLink();
    } else if (topic.endsWith("/haptic_report")) {
      plots.report(value);
    } else if (topic.endsWith("/device_state")) {
      model.moveDevice(value.device, "device", value.pose);
    } else if (topic.endsWith("/device_command")) {
      model.moveDevice(value.device, "proxy", value.pose);
      model.forces.set(value.device, value.wrench.force);
      if (value.device === touch.user) view.touch();
    } else {
      touch.receive(topic, value);
    }
  },
  refused: (text) => controls.say("refused", text),
});
const controls = new Controls(connection, model);
const replay = new Replay(controls, model);
controls.enable(false);
const touch = new Touch(connection, view, model, element<HTMLCanvasElement>("view"));
const toolBar = new ToolBar(element("stage"), touch, view, () => model.userCount);
touch.changed = () => {
  toolBar.show();
  subscribe();
};

/** What is shown is subscribed to, and nothing else. */
function subscribe(): void {
  const wanted = ["/scene", "/joints", "/status", "/program_place", "/control_reply", "/verdict"];
  if (!document.hidden) {
    wanted.push(...touch.topics());
    wanted.push("/world_view");
    const kinds = [
      ...(view.arrows.showDevices ? ["device_state"] : []),
      ...(view.arrows.showDevices || view.arrows.showForces || plots.isOpen("force") ? ["device_command"] : []),
      ...(plots.isOpen("steps") || plots.isOpen("energy") ? ["haptic_report"] : []),
    ];
    for (let user = 0; user < model.userCount; ++user) wanted.push(...kinds.map((kind) => `/user_${user}/${kind}`));
  }
  connection.want(wanted);
}

function showLink(): void {
  const chip = element("link");
  const world = [...model.programs.values()].find((one) => PROGRAMS[one.status.program] === "world_sim");
  const states: Record<Link, string> = {
    connecting: "connecting", live: model.paused ? "paused" : world?.status.state ?? "live", frozen: `no data for ${linkDetail}`,
    lost: "connection lost", ended: "run ended",
  };
  chip.textContent = states[link];
  chip.className = `chip ${link === "live" && model.paused ? "paused" : link}`;
  banner.show(link, linkDetail, model);
}

function describe(): void {
  element("scene").textContent = model.name;
  document.title = `${model.name} – Subworld`;
  controls.describe();
  replay.describe();
  const cameras = view.cameras.map((camera, i) => {
    const button = document.createElement("button");
    button.textContent = camera.name;
    button.title = i < 10 ? `Key ${i}` : "";
    button.onclick = () => choose(i);
    return button;
  });
  element("cameras").replaceChildren(...cameras);
  choose(0);
  const row = (text: string, ...swatches: [string, string][]) => {
    const line = document.createElement("li");
    for (const [colour, kind] of swatches) {
      const swatch = document.createElement("span");
      swatch.className = `swatch ${kind}`;
      swatch.style.background = colour;
      line.append(swatch);
    }
    line.append(text);
    return line;
  };
  const users = Array.from({ length: model.userCount }, (_, user) => {
    const colour = userColour(user);
    return row(model.userCount === 1 ? "Proxy, sub-world, its border" : `User ${user}: proxy, sub-world, border`,
      [colour, "proxy"], [colour, "member"], [colour, "border"]);
  });
  element("users").replaceChildren(...users);
  fits = 0;
  fit();
  const list = [...model.settings].flatMap(([name, value]) => {
    const dt = document.createElement("dt"), dd = document.createElement("dd");
    dt.textContent = name.replace(/^settings\./, "");
    dd.textContent = value;
    return [dt, dd];
  });
  element("settings").querySelector("dl")!.replaceChildren(...list);
  subscribe();
}

/** The scene's description holds the bodies before they settled; the cameras fit what is seen now. */
function fit(): void {
  ++fits;
  view.fit();
  const step = view.ground.step_m;
  element("grid").textContent = view.bodies.floor === null ? "" : `Grid ${step < 1 ? `${Number((100 * step).toPrecision(1))} cm` : `${step} m`}`;
}

function choose(camera: number): void {
  view.choose(camera);
  [...element("cameras").children].forEach((one, i) => one.setAttribute("aria-pressed", String(i === view.chosen)));
}

function select(id: number): void {
  view.bodies.selected = id;
  view.update();
  showCard();
}

function showCard(): void {
  const id = view.bodies.selected, card = element("card"), body = model.bodies[id];
  card.hidden = !body;
  if (!body) return;
  const at = 7 * id, pose = model.states.to;
  const user = model.users.find((one) => one.proxy === id || one.members.includes(id));
  const border = model.users.find((one) => one.border.some((pair) => pair.inside === id || pair.outside === id));
  const state = model.isFixed(body) ? "fixed to the world"
    : user ? (user.proxy === id ? `proxy of user ${user.user}` : `in the sub-world of user ${user.user}`)
    : border ? `at the border of user ${border.user}` : "in the world only";
  const facts: [string, string][] = [
    ["mass", model.isFixed(body) ? "–" : `${Number(body.mass.toPrecision(4))} kg`],
    ["position", `${[0, 1, 2].map((k) => pose[at + k].toFixed(3)).join(", ")} m`],
    ["speed", `${model.states.speed[id].toFixed(3)} m/s`],
    ["friction", String(Number(body.friction.toPrecision(3)))],
    ["restitution", String(Number(body.restitution.toPrecision(3)))],
  ];
  const force = user?.proxy === id ? model.forces.get(user.user) : undefined;
  if (force) facts.push(["force on the operator", `${length(force).toFixed(2)} N`]);
  const title = document.createElement("h2"), kind = document.createElement("p"), list = document.createElement("dl");
  title.textContent = body.name || `body ${id}`;
  kind.className = "kind";
  kind.textContent = `${SHAPES[body.shape]} ${id}, ${state}`;
  for (const [name, value] of facts) {
    const dt = document.createElement("dt"), dd = document.createElement("dd");
    dt.textContent = name;
    dd.textContent = value;
    list.append(dt, dd);
  }
  card.replaceChildren(title, kind, list);
}

/** A length that is easy to read, beside what it stands for. */
function scaleText(name: string, unit: string, perUnit: number, reference_m: number): string {
  return perUnit > 0 ? `${name}, ${Number(niceBelow(reference_m / perUnit).toPrecision(1))} ${unit} = ${Number((100 * perUnit * niceBelow(reference_m / perUnit)).toPrecision(2))} cm` : name;
}

let traffic = { at: performance.now(), bytes: 0 };
let ticked = performance.now();
setInterval(() => {
  const now = performance.now();
  if (now - ticked > 1500) model.excuse(now - ticked);
  ticked = now;
  element("time").textContent = model.snapshots ? `${model.time_s.toFixed(2)} s` : "–";
  const factor = model.realTimeFactor;
  element("factor").textContent = model.snapshots ? (factor < 0.995 ? `${factor.toFixed(2)} × real time` : "real time") : "";
  if (element<HTMLDetailsElement>("topology").open) programs.show(model, now, view.pace.number > 1);
  element("forceScale").textContent = scaleText("Operator's force", "N", view.arrows.forceScale.perUnit, 2 * view.ground.step_m);
  element("impulseScale").textContent = scaleText("Border impulses", "N s", view.arrows.impulseScale.perUnit, 2 * view.ground.step_m);
  showCard();
  if (now - traffic.at > 1900) {
    const rate = (1000 * (connection.bytes - traffic.bytes)) / (now - traffic.at);
    const text = rate >= 1e6 ? `${(rate / 1e6).toFixed(1)} MB/s` : `${Math.round(rate / 1e3)} kB/s`;
    element("traffic").textContent = `${Math.round(view.framesPerSecond)} frames/s drawn, ${text} received, ${model.bodies.length} ${model.bodies.length === 1 ? "body" : "bodies"}`;
    traffic = { at: now, bytes: connection.bytes };
  }
}, 250);

function drawPlots(now: number): void {
  requestAnimationFrame(drawPlots);
  plots.draw(now, view.pace.number > 1);
}
requestAnimationFrame(drawPlots);

followTheme(element<HTMLButtonElement>("theme"), () => {
  view.restyle();
  plots.restyle();
});
view.picked = (id) => touch.user < 0 && select(id); // else a click belongs to the tool
for (const [id, key] of [["forces", "showForces"], ["impulses", "showImpulses"], ["devices", "showDevices"]] as const)
  element<HTMLInputElement>(id).onchange = (event) => {
    view.arrows[key] = (event.target as HTMLInputElement).checked;
    view.touch();
    subscribe();
  };
element<HTMLInputElement>("joints").onchange = (event) => {
  view.joints.root.visible = (event.target as HTMLInputElement).checked;
  view.touch();
};
for (const details of document.querySelectorAll("details[data-plot]")) details.addEventListener("toggle", subscribe);
document.addEventListener("visibilitychange", subscribe);

const nameField = element<HTMLInputElement>("name");
element<HTMLFormElement>("find").onsubmit = (event) => {
  event.preventDefault();
  const wanted = nameField.value.trim().toLowerCase();
  const found = model.bodies.find((one) => one.name.toLowerCase() === wanted)
    ?? model.bodies.find((one) => wanted && one.name.toLowerCase().includes(wanted));
  nameField.classList.toggle("none", !found && wanted !== "");
  select(found?.id ?? -1);
};

document.addEventListener("keydown", (event) => {
  const target = event.target as HTMLElement;
  if (touch.key(event)) return event.preventDefault();
  if (event.key === "Escape") return select(-1), target.blur();
  if (event.ctrlKey || event.metaKey || event.altKey || target.closest("input, select, textarea")) return;
  const inView = target.id === "view" || target === document.body;
  const turns: Record<string, [number, number, number]> = {
    ArrowLeft: [-0.1, 0, 1], ArrowRight: [0.1, 0, 1], ArrowUp: [0, -0.1, 1], ArrowDown: [0, 0.1, 1],
    "+": [0, 0, 0.88], "=": [0, 0, 0.88], "-": [0, 0, 1 / 0.88],
  };
  if (inView && turns[event.key]) view.orbit(...turns[event.key]);
  else if (event.key === " " && inView) replay.active ? replay.play() : controls.togglePause();
  else if (event.key === "s" && link === "live") controls.step();
  else if (event.key === "t") element("theme").click();
  else if (event.key === "/") nameField.focus();
  else if (/^[0-9]$/.test(event.key)) choose(Number(event.key));
  else return;
  event.preventDefault();
});

// What a test reads.
Object.assign(window, {
  subworld: () => ({
    link, time_s: model.time_s, paused: model.paused, frames: view.frames, framesPerSecond: view.framesPerSecond,
    bytes: connection.bytes, bodies: model.bodies.length, users: model.users.length, answers: controls.answers,
    placed: view.bodies.placed, tier: view.pace.number, joints: view.joints.shown, points: plots.force.points, devices: model.devices.size, programs: model.programs.size,
    tool: { offered: touch.tools.length, user: touch.user, holds: touch.holds, sent: touch.sent, offset: touch.offset.toArray(), orientation: touch.orientation.toArray(), force: touch.force },
  }),
});
