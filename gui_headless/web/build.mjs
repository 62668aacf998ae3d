// build.mjs SOURCES WEB PAGE_CPP: bundles SOURCES with the packages in WEB/node_modules into one HTML, WEB/page.html, and
// writes it, compressed, as C++.
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { constants, gzipSync } from "node:zlib";

const [sources, web, output] = process.argv.slice(2);
const packages = createRequire(join(web, "package.json"));
const esbuild = packages("esbuild");

const bundle = (entry) =>
  esbuild.buildSync({
    absWorkingDir: sources,
    entryPoints: [entry],
    bundle: true,
    minify: true,
    write: false,
    nodePaths: [join(web, "node_modules")],
    target: "es2022",
    legalComments: "none",
    logLevel: "warning",
  }).outputFiles[0].text;

const licence = (name) => `${name}\n${readFileSync(join(web, "node_modules", name, "LICENSE"), "utf8").trim()}`;
const parts = {
  STYLE: bundle("style.css"),
  SCRIPT: bundle("src/main.ts").replaceAll("</script", "<\\/script"),
  LICENCES: ["three", "uplot"].map(licence).join("\n\n").replaceAll("&", "&amp;").replaceAll("<", "&lt;"),
};
const html = readFileSync(join(sources, "index.html"), "utf8").replace(/\{\{(\w+)\}\}/g, (_, part) => parts[part]);
writeFileSync(join(web, "page.html"), html);

const bytes = gzipSync(html, { level: constants.Z_BEST_COMPRESSION });
const octal = (byte) => `\\${byte.toString(8).padStart(3, "0")}`;
const lines = [];
for (let at = 0; at < bytes.length; at += 64) lines.push(`    "${[...bytes.subarray(at, at + 64)].map(octal).join("")}"`);
writeFileSync(
  output,
  `#include <cstdint>
#include <span>

namespace subworld::live {
namespace {
constexpr char kPage[] =
${lines.join("\n")};
}  // namespace

std::span<const std::uint8_t> page_gzip() noexcept {
  return {reinterpret_cast<const std::uint8_t*>(kPage), sizeof kPage - 1};
}
}  // namespace subworld::live
`,
);
