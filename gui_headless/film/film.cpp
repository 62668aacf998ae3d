#include "film/recorded_world.hpp"
#include "io/options.hpp"
#include "io/results.hpp"
#include "model/error.hpp"
#include "picture.hpp"

#include <fmt/core.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace subworld {
namespace {

struct Request {
  std::string file;
  std::string out = "out/film";
  std::optional<double> from_s, to_s;
  double speed = 1.0;
  double rate_hz = 30.0;
  std::vector<double> eye, target;
  PictureSize size;
};

void add_options(CommandLine& line, Request& r) {
  line.add("file", &r.file, "recording, as `subworld run --record` writes it").required();
  line.add("--out", &r.out, "folder for the pictures");
  line.add("--from", &r.from_s, "first moment, simulated time").range(0.0, 1e6, "s").otherwise("the recording's start");
  line.add("--to", &r.to_s, "last moment, simulated time").range(0.0, 1e6, "s").otherwise("the recording's end");
  line.add("--speed", &r.speed, "simulated time per time of the film: below 1 is slow motion").range(1e-4, 1e4);
  line.add("--rate", &r.rate_hz, "pictures per second of the film").range(0.1, 1000.0, "Hz");
  const Option eye = line.add("--eye", &r.eye, "place of the camera, X,Y,Z in metres").otherwise("sees all bodies");
  line.add("--target", &r.target, "with --eye: what is in the middle of the picture, X,Y,Z in metres")
      .otherwise("0,0,0")
      .needs(eye);
  line.add("--width", &r.size.width, "pixels").range(16, 8192);
  line.add("--height", &r.size.height, "pixels").range(16, 8192);
  line.footer(
      "Examples:\n"
      "  subworld film run.mcap --out out/film\n"
      "  subworld film run.mcap --from 2 --to 3 --speed 0.1 --eye 1,-1,0.5\n"
      "Where ffmpeg is installed, it also makes film.mp4 of the pictures.\n"
      "Exit codes: 0 done, 1 failed while running, 2 usage or no finished recording.");
}

std::optional<Camera> camera_of(const Request& request) {
  const auto place_of = [](const std::vector<double>& given, const char* name) -> Vec3 {
    if (given.empty()) return Vec3::Zero();
    if (given.size() == 3) return {given[0], given[1], given[2]};
    throw Error(ExitCode::usage, fmt::format("{}: three numbers are needed, as in {} 1,-1,0.5", name, name));
  };
  if (request.eye.empty()) return {};
  return Camera{.eye = place_of(request.eye, "--eye"), .target = place_of(request.target, "--target")};
}

/// Makes a video of the first pictures in the folder where the encoder is installed. Returns its file; empty: there is
/// none.
std::string encode(const Request& request, std::size_t pictures) {
  const std::string video = request.out + "/film.mp4", rate = fmt::format("{}", request.rate_hz),
                    names = request.out + "/frame_%06d.png";
  std::vector<std::string> words{"ffmpeg",     "-y",
                                 "-loglevel",  "error",
                                 "-framerate", rate,
                                 "-i",         names,
                                 "-frames:v",  std::to_string(pictures),
                                 "-pix_fmt",   "yuv420p",
                                 "-vf",        "pad=ceil(iw/2)*2:ceil(ih/2)*2",
                                 video};
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t pid = -1;
  if (posix_spawnp(&pid, "ffmpeg", nullptr, nullptr, argv.data(), environ) != 0) return {};
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? video : "";
}

int make_film(const Request& request) {
  RecordedWorld world(request.file);
  const double from_s = std::clamp(request.from_s.value_or(world.from_s()), world.from_s(), world.to_s());
  const double to_s = std::clamp(request.to_s.value_or(world.to_s()), world.from_s(), world.to_s());
  if (to_s < from_s) throw Error(ExitCode::usage, fmt::format("--to {} is before --from {}", to_s, from_s));
  std::optional<Camera> camera = camera_of(request);
  make_folder(request.out);
  std::optional<double> line_m_per_n_s;
  const double interval_s = request.speed / request.rate_hz;
  const auto frames = static_cast<std::size_t>(std::floor((to_s - from_s) / interval_s + 1e-9)) + 1;
  for (std::size_t i = 0; i < frames; ++i) {
    world.show(from_s + static_cast<double>(i) * interval_s);
    const Drawing drawing = draw({.bodies = world.scene().bodies,
                                  .states = world.states(),
                                  .meshes = world.scene().meshes,
                                  .users = world.users(),
                                  .camera = camera,
                                  .line_m_per_n_s = line_m_per_n_s},
                                 request.size);
    camera = drawing.camera;
    if (drawing.line_m_per_n_s > 0.0) line_m_per_n_s = drawing.line_m_per_n_s;
    write_png(fmt::format("{}/frame_{:06d}.png", request.out, i), drawing.image);
  }
  fmt::print("film: {} pictures of t = {:.3f} to {:.3f} s in {}/frame_*.png\n", frames, from_s,
             from_s + static_cast<double>(frames - 1) * interval_s, request.out);
  std::fflush(stdout);
  const std::string video = encode(request, frames);
  fmt::print("{}\n", video.empty() ? "no video: ffmpeg is not installed, or cannot encode it" : "video: " + video);
  return static_cast<int>(ExitCode::done);
}

int main_of(int argc, char** argv) {
  Request request;
  CommandLine line("subworld film", "Makes pictures, and a video, of a recording.");
  add_options(line, request);
  if (const auto code = line.parse(argc, argv)) return *code;
  return make_film(request);
}

}  // namespace
}  // namespace subworld

int main(int argc, char** argv) {
  return subworld::guarded("subworld film", [&] { return subworld::main_of(argc, argv); });
}
