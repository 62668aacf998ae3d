// The floor: a plane with a grid, which fades into the sky.
import * as THREE from "three";
import { LIT, litAtCorners } from "./corner_light";
import { theme } from "./theme";

const GRID = `
varying vec2 vGround;
uniform float gridStep, reach;
uniform vec2 centre;
float lines(vec2 at, vec2 width) {
  vec2 near = abs(fract(at - 0.5) - 0.5) / max(width, 1e-6);
  return (1.0 - min(min(near.x, near.y), 1.0)) * clamp(1.0 - 2.0 * max(width.x, width.y), 0.0, 1.0);
}
float grid() {
  vec2 at = vGround / gridStep, width = fwidth(at);
  return max(0.55 * lines(at, width), lines(0.1 * at, 0.1 * width));
}
float sky() {
  return smoothstep(0.25, 1.0, distance(vGround, centre) / reach);
}`;
const PLACE = "vGround = (modelMatrix * vec4(position, 1.0)).xy;";

export class Ground {
  readonly mesh: THREE.Mesh<THREE.PlaneGeometry, THREE.Material>;
  step_m = 0.1;
  private readonly colours = { ground: { value: new THREE.Color() }, line: { value: new THREE.Color() }, sky: { value: new THREE.Color() } };
  private readonly uniforms = { gridStep: { value: 0.1 }, reach: { value: 1 }, centre: { value: new THREE.Vector2() } };
  private readonly lit = new THREE.MeshLambertMaterial();
  private readonly cornerLit: THREE.Material;

  constructor() {
    this.lit.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, this.uniforms, { lineColour: this.colours.line, skyColour: this.colours.sky });
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nvarying vec2 vGround;")
        .replace("#include <begin_vertex>", `#include <begin_vertex>\n${PLACE}`);
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", `#include <common>\nuniform vec3 lineColour, skyColour;\n${GRID}`)
        .replace("#include <color_fragment>", "#include <color_fragment>\ndiffuseColor.rgb = mix(diffuseColor.rgb, lineColour, grid());")
        .replace("#include <opaque_fragment>", "#include <opaque_fragment>\ngl_FragColor.rgb = mix(gl_FragColor.rgb, skyColour, sky());");
    };
    this.cornerLit = litAtCorners({
      uniforms: { ...this.uniforms, ground: this.colours.ground, line: this.colours.line, skyColour: this.colours.sky },
      vertexShader: `
        ${LIT}
        uniform vec3 ground, line, skyColour;
        varying vec3 vGroundColour, vLine, vSky;
        varying vec2 vGround;
        void main() {
          ${PLACE}
          vec3 up = normalize(normalMatrix * normal);
          vGroundColour = lit(ground, up);
          vLine = lit(line, up);
          vSky = sRGBTransferOETF(vec4(skyColour, 1.0)).rgb;
          gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
        }`,
      fragmentShader: `
        varying vec3 vGroundColour, vLine, vSky;
        ${GRID}
        void main() {
          gl_FragColor = vec4(mix(mix(vGroundColour, vLine, grid()), vSky, sky()), 1.0);
        }`,
    });
    this.mesh = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), this.lit);
    this.mesh.receiveShadow = true;
    this.mesh.renderOrder = 0.5; // bodies hide most of it
  }

  /** With shadows, or without. */
  shade(shadows: boolean): void {
    this.mesh.material = shadows ? this.lit : this.cornerLit;
  }

  restyle(): void {
    const { sky, ground, grid } = theme();
    this.colours.sky.value.set(sky);
    this.colours.line.value.set(grid);
    this.colours.ground.value.set(ground);
    this.lit.color.set(ground);
  }

  /** Below bodies within a radius around a centre; `height_m` null: there is no floor. */
  fit(centre: THREE.Vector3, radius: number, height_m: number | null): void {
    this.mesh.visible = height_m !== null;
    this.mesh.position.set(centre.x, centre.y, height_m ?? 0);
    this.mesh.scale.setScalar(10 * radius);
    this.step_m = 10 ** Math.round(Math.log10(radius / 4));
    this.uniforms.gridStep.value = this.step_m;
    this.uniforms.reach.value = 9 * radius;
    this.uniforms.centre.value.set(centre.x, centre.y);
  }
}
