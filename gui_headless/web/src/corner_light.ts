// Light for a processor that draws in the place of a graphics card: computed at the corners of the triangles, in the colour
// space of the screen. A pixel then costs an interpolation.
import * as THREE from "three";

/** GLSL for a vertex shader: `lit(colour, normal in view space)`, as the screen shows it. */
export const LIT = `
#include <common>
#include <colorspace_pars_fragment>
#include <lights_pars_begin>
vec3 lit(vec3 colour, vec3 facing) {
  vec3 light = vec3(0.0);
  #if NUM_HEMI_LIGHTS > 0
    light += getHemisphereLightIrradiance(hemisphereLights[0], facing);
  #endif
  #if NUM_DIR_LIGHTS > 0
    light += max(dot(facing, directionalLights[0].direction), 0.0) * directionalLights[0].color;
  #endif
  return sRGBTransferOETF(vec4(min(RECIPROCAL_PI * colour * light, 1.0), 1.0)).rgb;
}`;

/** A material that has the scene's lights. */
export function litAtCorners(parameters: THREE.ShaderMaterialParameters): THREE.ShaderMaterial {
  const lights = THREE.UniformsUtils.clone(THREE.UniformsLib.lights);
  return new THREE.ShaderMaterial({ ...parameters, uniforms: { ...lights, ...parameters.uniforms }, lights: true });
}

/** GLSL of a pixel of a body. EDGES: edges of boxes are darker. */
export const BODY_PIXELS = `
uniform float opacity;
varying vec3 vLit;
varying vec2 vFace;
void main() {
  vec3 colour = vLit;
  #ifdef EDGES
    vec2 side = min(vFace, 1.0 - vFace) / (0.035 + fwidth(vFace));
    colour *= mix(0.84, 1.0, smoothstep(0.25, 1.1, min(side.x, side.y)));
  #endif
  gl_FragColor = vec4(colour, opacity);
}`;

/** What a body looks like: like `source`. */
export function bodyLitAtCorners(source: THREE.Material, hasEdges: boolean): THREE.ShaderMaterial {
  return litAtCorners({
    uniforms: { opacity: { value: source.opacity } },
    transparent: source.transparent, depthWrite: source.depthWrite, side: source.side,
    defines: hasEdges ? { EDGES: "" } : {},
    vertexShader: `
      ${LIT}
      varying vec3 vLit;
      varying vec2 vFace;
      void main() {
        mat4 place = modelViewMatrix;
        vec3 facing = normal, colour = vec3(1.0);
        #ifdef USE_INSTANCING
          mat3 turn = mat3(instanceMatrix);
          facing = turn * (facing / vec3(dot(turn[0], turn[0]), dot(turn[1], turn[1]), dot(turn[2], turn[2])));
          place = place * instanceMatrix;
        #endif
        #ifdef USE_INSTANCING_COLOR
          colour = instanceColor;
        #endif
        vLit = lit(colour, normalize(normalMatrix * facing));
        vFace = uv;
        gl_Position = projectionMatrix * (place * vec4(position, 1.0));
      }`,
    fragmentShader: BODY_PIXELS,
  });
}
