#include "import/world.hpp"
#include "io/options/options.hpp"
#include "io/results/output.hpp"
#include "model/error.hpp"
#include "model/scene/scene.hpp"
#include "tools.hpp"

#include <fmt/core.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace {

using namespace subworld;

/// Whether the root element of an XML file is <mujoco>.
bool is_mjcf(const std::string& file) {
  std::ifstream in(file);
  if (!in) throw Error(ExitCode::usage, fmt::format("{}: cannot be read", file));
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  return text.find("<mujoco") != std::string::npos && text.find("<sdf") == std::string::npos &&
         text.find("<robot") == std::string::npos;
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld import", about_tool("import"));
  std::string from, to;
  bool strict = false;
  line.add("file", &from, "world or model in SDFormat, robot in URDF, or model in MJCF").required();
  line.add("--out", &to, "the scene file to write; meshes go to the folder `meshes` beside it").required();
  line.flag("--strict", strict, "exit code 2, and no scene, where something of the file has no counterpart");
  line.footer(
      "Examples:\n"
      "  subworld import world.sdf --out scene.yaml\n"
      "  subworld import robot.urdf --out robot/scene.yaml --strict\n"
      "  subworld run scene.yaml --device browser --page");
  if (const auto code = line.parse(argc, argv)) return *code;
  const std::filesystem::path out = std::filesystem::absolute(to);
  std::filesystem::create_directories(out.parent_path());
  import::World world = is_mjcf(from) ? import::read_mjcf(from, out.parent_path() / "meshes") : import::read_sdf(from);
  // An earlier scene of this name stays until the new one is complete.
  const std::filesystem::path part = out.parent_path() / (out.filename().string() + ".part");
  import::write_scene(world, part);
  for (const import::Remark& remark : world.remarks) {
    const std::string place = remark.line > 0 ? fmt::format("{}:{}", from, remark.line) : from;
    fmt::print(stderr, "{}: {}\n", place, remark.what);
  }
  if (strict && !world.remarks.empty()) {
    std::filesystem::remove(part);
    throw Error(ExitCode::usage,
                fmt::format("{}: {} things have no counterpart (--strict)", from, world.remarks.size()));
  }
  const Scene scene = load_scene(part.string());
  std::filesystem::rename(part, out);
  fmt::print("{}: {} bodies, {} joints; {} remarks\n", out.string(), scene.bodies.size(), scene.joints.size(),
             world.remarks.size());
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld import",
                            subworld::guarded("subworld import", [&] { return main_of(argc, argv); }));
}
