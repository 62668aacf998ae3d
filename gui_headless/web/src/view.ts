// The three-dimensional view: draws only when something has changed.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { Arrows } from "./arrows";
import { Bodies, radiusOf } from "./bodies";
import { Ground } from "./ground";
import { Joints } from "./joints";
import type { Model } from "./model";
import { Pace, pictureOn, SOFTWARE_TIER } from "./pace";
import { theme } from "./theme";

export type Camera = { name: string; user: number };

export class View {
  readonly bodies = new Bodies();
  readonly arrows = new Arrows();
  readonly joints = new Joints();
  readonly cameras: Camera[] = [];
  chosen = 0;
  frames = 0;
  framesPerSecond = 0;
  picked?: (id: number) => void;
  /** Before each picture. */
  drawn?: () => void;
  private readonly canvas: HTMLCanvasElement;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(38, 1, 0.01, 500);
  private readonly controls: OrbitControls;
  private readonly sun = new THREE.DirectionalLight("#fffaf0");
  private readonly sky = new THREE.HemisphereLight();
  readonly ground = new Ground();
  private dirty = true;
  private moved = false; // by the user
  readonly pace: Pace;
  private readonly shadow = { stale: true, age: 0 }; // the map lacks motion; frames since it was drawn
  private drew = false;
  private last = 0;
  private bodyRadius = 0.1;
  private readonly followed = new THREE.Vector3();
  private counted = { at: performance.now(), frames: 0 };

  /** Another canvas may take the place of this one. */
  constructor(place: HTMLCanvasElement, private readonly model: Model) {
    const { canvas, context, software } = pictureOn(place);
    this.canvas = canvas;
    document.body.classList.toggle("slow", software);
    this.bodies.software = software;
    this.pace = new Pace(software ? SOFTWARE_TIER : 0);
    this.renderer = new THREE.WebGLRenderer({ canvas, context: context ?? undefined });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.autoUpdate = false;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.camera.up.set(0, 0, 1);
    this.sky.position.set(0, 0, 1);
    this.sun.shadow.radius = 3;
    this.sun.shadow.normalBias = 0.02;
    this.scene.add(this.sky, this.sun, this.sun.target, this.ground.mesh, this.bodies.root, this.joints.root, this.arrows.root);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = 0.495 * Math.PI;
    this.controls.addEventListener("change", () => this.touch());
    this.controls.addEventListener("start", () => (this.moved = true));
    canvas.after(this.arrows.values);
    this.applyTier();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    this.listen();
    this.restyle();
    const draw = () => {
      requestAnimationFrame(draw);
      this.drew = this.frame();
    };
    draw();
  }

  touch(): void {
    this.dirty = true;
  }

  add(object: THREE.Object3D): void {
    this.scene.add(object);
  }

  /** Radius of a usual body, m. */
  size_m(): number {
    return this.bodyRadius;
  }

  /** Right, up and near in the picture. */
  axes(): { x: THREE.Vector3; y: THREE.Vector3; z: THREE.Vector3 } {
    const [x, y, z] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    this.camera.matrixWorld.extractBasis(x, y, z);
    return { x, y, z };
  }

  /** The ray through a pixel. */
  caster(event: MouseEvent): THREE.Raycaster {
    const area = this.canvas.getBoundingClientRect(), ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * (event.clientX - area.left)) / area.width - 1,
      1 - (2 * (event.clientY - area.top)) / area.height), this.camera);
    return ray;
  }

  /** Whether the left button and one finger turn the camera; else the right button and two fingers do. */
  turnWithLeft(on: boolean): void {
    const { MOUSE, TOUCH } = THREE, none = null as unknown as THREE.MOUSE & THREE.TOUCH;
    this.controls.mouseButtons = on ? { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN }
      : { LEFT: none, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.ROTATE };
    this.controls.touches = on ? { ONE: TOUCH.ROTATE, TWO: TOUCH.DOLLY_PAN } : { ONE: none, TWO: TOUCH.DOLLY_ROTATE };
  }

  /** A new scene. */
  build(): void {
    const { model } = this;
    this.bodies.build(model);
    this.arrows.reset();
    const radii = model.bodies.filter((one) => !model.isFixed(one)).map((one) => radiusOf(one, model.meshes));
    radii.sort((a, b) => a - b);
    this.bodyRadius = radii[radii.length >> 1] || 0.1;
    model.states.unseen_m = 2e-4 * this.bodyRadius;
    this.cameras.length = 0;
    this.cameras.push({ name: "Whole scene", user: -1 });
    for (let user = 0; user < model.userCount; ++user) this.cameras.push({ name: `User ${user}`, user });
    this.cameras.push({ name: "From above", user: -2 });
    this.moved = false;
    this.update();
  }

  /** Fits ground, light and camera to where the bodies are. */
  fit(): void {
    this.bodies.place(this.model, performance.now() + 1000, this.camera.position);
    this.fitGround();
    if (!this.moved) this.choose(this.chosen);
  }

  /** New data. */
  update(): void {
    this.bodies.paint(this.model);
    this.touch();
  }

  restyle(): void {
    const { sky, ground, hemisphere, sun } = theme();
    this.scene.background = new THREE.Color(sky);
    this.ground.restyle();
    this.sky.color.set("#ffffff");
    this.sky.groundColor.set(ground);
    this.sky.intensity = hemisphere;
    this.sun.intensity = sun;
    this.describeLight();
    this.bodies.repaint(this.model);
    this.touch();
  }

  choose(index: number): void {
    const camera = this.cameras[index];
    if (!camera) return;
    this.chosen = index;
    const { centre, radius } = this.extent();
    const proxy = this.model.users.find((one) => one.user === camera.user)?.proxy;
    const from = camera.user === -2 ? new THREE.Vector3(0, -0.01, 1) : new THREE.Vector3(0.62, -1, 0.62);
    let reach = radius;
    if (camera.user >= 0 && proxy !== undefined) {
      this.bodies.position(proxy, centre);
      this.followed.copy(centre);
      reach = Math.min(radius, 5.5 * this.bodyRadius);
    }
    const narrow = Math.min(1, this.camera.aspect);
    const distance = (1.12 * reach) / Math.sin(THREE.MathUtils.degToRad(this.camera.fov / 2)) / narrow;
    this.controls.target.copy(centre);
    this.camera.position.copy(from.normalize().multiplyScalar(distance).add(centre));
    this.controls.update();
    this.touch();
  }

  /** Turns (radians) and approaches (factor), for the keyboard. */
  orbit(turn: number, lift: number, factor: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const polar = new THREE.Spherical().setFromVector3(new THREE.Vector3(offset.x, offset.z, -offset.y));
    polar.theta += turn;
    polar.phi = THREE.MathUtils.clamp(polar.phi + lift, 0.01, 0.49 * Math.PI);
    polar.radius *= factor;
    const to = new THREE.Vector3().setFromSpherical(polar);
    this.camera.position.set(to.x, -to.z, to.y).add(this.controls.target);
    this.controls.update();
    this.touch();
  }

  /** Centre and radius of what can move. */
  private extent(): { centre: THREE.Vector3; radius: number } {
    const box = new THREE.Box3(), at = new THREE.Vector3(), { model } = this;
    const movable = model.bodies.filter((one) => !model.isFixed(one));
    for (const body of movable) {
      this.bodies.position(body.id, at);
      if (!Number.isFinite(at.x + at.y + at.z)) continue;
      const r = radiusOf(body, model.meshes) * 0.7;
      box.union(new THREE.Box3(at.clone().subScalar(r), at.clone().addScalar(r)));
    }
    if (box.isEmpty()) box.set(new THREE.Vector3(-0.5, -0.5, 0), new THREE.Vector3(0.5, 0.5, 1));
    const centre = box.getCenter(new THREE.Vector3());
    return { centre, radius: Math.max(0.5 * box.getSize(at).length(), 1e-3) };
  }

  private fitGround(): void {
    const { centre, radius } = this.extent();
    this.ground.fit(centre, radius, this.bodies.floor);
    this.camera.near = radius / 200;
    this.camera.far = radius * 60;
    this.camera.updateProjectionMatrix();
    this.controls.minDistance = radius / 50;
    this.controls.maxDistance = radius * 20;
    const light = 1.25 * radius;
    this.sun.target.position.copy(centre);
    this.sun.position.set(-0.55, -0.75, 1.5).multiplyScalar(3 * radius).add(centre);
    this.describeLight();
    Object.assign(this.sun.shadow.camera, { left: -light, right: light, top: light, bottom: -light, near: 0.5 * radius,
      far: 12 * radius });
    this.sun.shadow.camera.updateProjectionMatrix();
    this.sun.shadow.normalBias = 0.02 * this.bodyRadius * 10;
    this.shadow.stale = true;
  }

  private describeLight(): void {
    const { sun, sky } = this, colour = (of: THREE.Color) => of.clone().multiplyScalar(sky.intensity);
    this.bodies.light = {
      toSun: sun.position.clone().sub(sun.target.position).normalize(), sun: sun.color.clone().multiplyScalar(sun.intensity),
      above: colour(sky.color), below: colour(sky.groundColor),
    };
  }

  private listen(): void {
    let down = { x: 0, y: 0 };
    this.canvas.addEventListener("pointerdown", (event) => (down = { x: event.clientX, y: event.clientY }));
    this.canvas.addEventListener("pointerup", (event) => {
      if (Math.hypot(event.clientX - down.x, event.clientY - down.y) > 4) return;
      this.picked?.(this.bodies.pick(this.caster(event)));
    });
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (!width || !height) return;
    const fits = this.camera.aspect !== 1 || this.frames > 0;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (!fits) this.choose(this.chosen);
    this.touch();
  }

  private follow(): void {
    const user = this.cameras[this.chosen]?.user ?? -1;
    const proxy = this.model.users.find((one) => one.user === user)?.proxy;
    if (user < 0 || proxy === undefined) return;
    const at = this.bodies.position(proxy, new THREE.Vector3());
    const shift = at.clone().sub(this.followed).multiplyScalar(0.08);
    this.followed.add(shift);
    this.camera.position.add(shift);
    this.controls.target.add(shift);
  }

  /** A slow machine draws fewer pixels, shadows less often, and in the end none. */
  private applyTier(): void {
    const { ratio, shadow } = this.pace.tier;
    this.renderer.setPixelRatio(Math.min(ratio, devicePixelRatio));
    this.sun.castShadow = shadow > 0;
    this.bodies.shade(shadow > 0);
    this.ground.shade(shadow > 0);
    if (shadow > 0 && this.sun.shadow.mapSize.x !== shadow) {
      this.sun.shadow.mapSize.setScalar(shadow);
      this.sun.shadow.map?.dispose();
      this.sun.shadow.map = null;
    }
    this.shadow.stale = true;
    this.shadow.age = this.pace.tier.every;
    this.resize();
  }

  /** False: there is nothing new to draw. */
  private frame(): boolean {
    const now = performance.now();
    if (now - this.counted.at > 1000) {
      this.framesPerSecond = (1000 * (this.frames - this.counted.frames)) / (now - this.counted.at);
      this.counted = { at: now, frames: this.frames };
    }
    if (this.drew && this.pace.take(now - this.last)) this.applyTier();
    this.last = now;
    if (!this.model.bodies.length) return false;
    if (!this.dirty && !this.shadow.stale && !this.model.states.changing(now)) return false;
    this.dirty = false;
    this.bodies.place(this.model, now, this.camera.position);
    this.follow();
    this.joints.place(this.bodies, this.model.brokenJoints);
    this.arrows.place(this.model, this.bodies, this.bodyRadius, this.camera);
    this.shadow.stale ||= this.bodies.placed > 0;
    if (this.shadow.stale && ++this.shadow.age >= this.pace.tier.every) {
      this.renderer.shadowMap.needsUpdate = true;
      this.shadow.stale = false;
      this.shadow.age = 0;
    }
    this.drawn?.();
    this.renderer.render(this.scene, this.camera);
    ++this.frames;
    return true;
  }
}
