// Colours of both themes. A user's colour is the same in the view, in the plots and in the list of programs.
import { Color } from "three";

export type Theme = {
  sky: string; ground: string; grid: string; body: string; fixed: string; ink: string; muted: string; line: string;
  hemisphere: number; sun: number;
};

export const THEMES: Record<"light" | "dark", Theme> = {
  light: {
    sky: "#eef1f5", ground: "#dfe4ea", grid: "#c3cbd6", body: "#d9d4c9", fixed: "#8fa0b5", ink: "#1b2330",
    muted: "#566274", line: "#d5dbe3", hemisphere: 1.5, sun: 2.1,
  },
  dark: {
    sky: "#11151b", ground: "#1b212a", grid: "#323b48", body: "#8b929c", fixed: "#5d6b7e", ink: "#e8ecf2",
    muted: "#9aa6b6", line: "#2b333f", hemisphere: 1.15, sun: 2.2,
  },
};

const USERS = ["#2f6fde", "#e0701b", "#17997b", "#a04fc4", "#d63f6c", "#7a8f1c", "#0f93b8", "#9b6a3c"];
export const JOINT = "#e815b5";
export const DEVICE_TINT = 0.45;

export function userColour(user: number): string {
  if (user < USERS.length) return USERS[user];
  return `#${new Color().setHSL((user * 0.381966) % 1, 0.6, 0.47).getHexString()}`;
}

let chosen: "light" | "dark" | null = null;
const system = matchMedia("(prefers-color-scheme: dark)");

let shown: "light" | "dark" = system.matches ? "dark" : "light";

export const themeName = (): "light" | "dark" => shown;
export const theme = (): Theme => THEMES[themeName()];

/** Calls `changed` at once, and when the theme changes by the system or by the switch. */
export function followTheme(button: HTMLButtonElement, changed: () => void): void {
  try {
    const kept = localStorage.getItem("subworld-theme");
    if (kept === "light" || kept === "dark") chosen = kept;
  } catch { /* a browser may keep nothing */ }
  const apply = () => {
    shown = chosen ?? (system.matches ? "dark" : "light");
    document.documentElement.dataset.theme = themeName();
    button.textContent = themeName() === "dark" ? "Light" : "Dark";
    button.title = `Switch to the ${themeName() === "dark" ? "light" : "dark"} theme (T)`;
    changed();
  };
  button.onclick = () => {
    chosen = themeName() === "dark" ? "light" : "dark";
    try {
      localStorage.setItem("subworld-theme", chosen);
    } catch { /* likewise */ }
    apply();
  };
  system.onchange = apply;
  apply();
}
