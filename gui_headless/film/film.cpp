#include "io/options/options.hpp"
#include "io/records/mcap_reader.hpp"
#include "io/results/replacing.hpp"
#include "io/results/results.hpp"
#include "io/version.hpp"
#include "model/error.hpp"
#include "model/messages/exchange.hpp"
#include "picture.hpp"
#include "wire/codec/codec.hpp"

#include <fmt/core.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace subworld {
namespace {

/// The world of a recording at any moment of its simulated time. All functions throw `Error` (usage) where the file is
/// no recording.
class RecordedWorld {
 public:
  explicit RecordedWorld(const std::string& file) : reader_(file), channel_(channel_of("/world_state")) {
    const std::uint16_t scene = channel_of("/scene");
    Codec<SceneDescription> codec;
    std::optional<double> first;
    for (std::size_t i = 0; i < reader_.chunks() && (scene_.bodies.empty() || !first); ++i) {
      const mcap::Chunk chunk = reader_.read_chunk(i);
      for (const mcap::Message& message : chunk.messages)
        if (message.channel == scene) (void)codec.decode(message.data, scene_);
      if (!first) first = first_stamp(chunk);
    }
    if (scene_.bodies.empty() || !first) {
      throw Error(
          ExitCode::usage,
          fmt::format("{}: holds no state of the world; record a run of another length, and with this version", file));
    }
    from_s_ = to_s_ = *first;
    for (std::size_t i = reader_.chunks(); i-- > 0 && to_s_ == from_s_;)
      for (const WorldSnapshot& snapshot : snapshots_of(reader_.read_chunk(i))) to_s_ = snapshot.stamp_s;
    show(from_s_);
  }

  [[nodiscard]] const SceneDescription& scene() const noexcept { return scene_; }
  [[nodiscard]] const std::string& lacks() const noexcept { return reader_.lacks(); }
  [[nodiscard]] double from_s() const noexcept { return from_s_; }
  [[nodiscard]] double to_s() const noexcept { return to_s_; }

  /// The moment that `states` and `users` show from now on; between two snapshots the states are interpolated. Moments
  /// outside the recording are its first or last one. Forward steps read each chunk once.
  void show(double time_s) {
    if (after_.states.empty() || time_s < before_.time_s) restart(time_s);
    while (after_.time_s < time_s && read_next()) {
    }
    const double span_s = after_.time_s - before_.time_s;
    const double part = span_s <= 0.0 ? 1.0 : std::clamp((time_s - before_.time_s) / span_s, 0.0, 1.0);
    shown_ = after_.states;
    for (std::size_t i = 0; i < shown_.size(); ++i) {
      const BodyState& from = before_.states[i];
      shown_[i].position = from.position + part * (after_.states[i].position - from.position);
      shown_[i].orientation = from.orientation.slerp(part, after_.states[i].orientation);
    }
    if (before_.users.empty()) before_.users = after_.users;
  }
  [[nodiscard]] const std::vector<BodyState>& states() const noexcept { return shown_; }
  [[nodiscard]] const std::vector<UserView>& users() const noexcept { return before_.users; }
  [[nodiscard]] const std::vector<std::uint32_t>& broken_joints() const noexcept { return before_.broken_joints; }

 private:
  struct Moment {
    double time_s = 0.0;
    std::vector<BodyState> states;
    std::vector<UserView> users;
    std::vector<std::uint32_t> broken_joints = {};
  };

  [[nodiscard]] std::uint16_t channel_of(const std::string& topic) const {
    const auto at = std::ranges::find(reader_.topics(), topic, [](const auto& one) { return one.second; });
    return at == reader_.topics().end() ? std::uint16_t{0} : at->first;
  }
  std::deque<WorldSnapshot> snapshots_of(const mcap::Chunk& chunk) {
    std::deque<WorldSnapshot> all;
    WorldSnapshot snapshot;
    for (const mcap::Message& message : chunk.messages)
      if (message.channel == channel_ && codec_.decode(message.data, snapshot)) all.push_back(snapshot);
    return all;
  }
  std::optional<double> first_stamp(const mcap::Chunk& chunk) {
    const auto all = snapshots_of(chunk);
    return all.empty() ? std::nullopt : std::optional(all.front().stamp_s);
  }
  /// Begins with a chunk early enough that a snapshot of all bodies comes before the moment.
  void restart(double time_s) {
    next_chunk_ = reader_.last_chunk_before(time_s - kCompleteSnapshot_s,
                                            [this](const mcap::Chunk& chunk) { return first_stamp(chunk); });
    read_.clear();
    before_ = after_ = {from_s_, scene_.states, {}};
  }
  bool read_next() {
    while (read_.empty() && next_chunk_ < reader_.chunks()) read_ = snapshots_of(reader_.read_chunk(next_chunk_++));
    if (read_.empty()) return false;
    before_ = after_;
    for (const StampedBody& moved : read_.front().moved)
      if (index(moved.id) < after_.states.size()) after_.states[index(moved.id)] = moved.state;
    after_.time_s = read_.front().stamp_s;
    after_.users = std::move(read_.front().users);
    after_.broken_joints = std::move(read_.front().broken_joints);
    read_.pop_front();
    return true;
  }

  mcap::Reader reader_;
  SceneDescription scene_;
  Codec<WorldSnapshot> codec_;
  std::uint16_t channel_ = 0;
  double from_s_ = 0.0, to_s_ = 0.0;
  std::size_t next_chunk_ = 0;
  std::deque<WorldSnapshot> read_;
  Moment before_, after_;
  std::vector<BodyState> shown_;
};

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
  const Option eye =
      line.add("--eye", &r.eye, "place of the camera, X,Y,Z in metres").otherwise("sees all bodies in all pictures");
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
      "Exit codes: 0 done, 1 failed while running, 2 usage or no recording.");
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

/// The moments that the pictures show.
struct Moments {
  double from_s = 0.0, interval_s = 0.0;
  std::size_t count = 0;

  [[nodiscard]] double operator[](std::size_t i) const { return from_s + static_cast<double>(i) * interval_s; }
};

/// The automatic camera of a picture of all places that the bodies visit: each body is at the corners of the box
/// around its path.
Camera camera_of_all(RecordedWorld& world, const Moments& moments, PictureSize size) {
  const std::vector<Body>& all = world.scene().bodies;
  std::vector<Box> paths(all.size());
  for (std::size_t i = 0; i < moments.count; ++i) {
    world.show(moments[i]);
    for (std::size_t b = 0; b < all.size(); ++b) {
      const Vec3& at = world.states()[b].position;
      if (i == 0) paths[b] = {at, at};
      paths[b].extend({at, at});
    }
  }
  std::vector<Body> bodies;
  std::vector<BodyState> states;
  for (std::size_t b = 0; b < all.size(); ++b) {
    const Box& path = paths[b];
    for (const int corner : {0, 1, 2, 3, 4, 5, 6, 7}) {
      if (corner > 0 && path.lower == path.upper) break;
      bodies.push_back(all[b]);
      states.push_back(world.states()[b]);
      for (int axis = 0; axis < 3; ++axis)
        states.back().position[axis] = ((corner >> axis) & 1) == 0 ? path.lower[axis] : path.upper[axis];
    }
  }
  return automatic_camera({.bodies = bodies,
                           .states = states,
                           .meshes = world.scene().meshes,
                           .users = world.users(),
                           .camera = {},
                           .line_m_per_n_s = {}},
                          size);
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
                                 "-metadata",  fmt::format("comment={}", kOwnMark),
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
  if (!world.lacks().empty()) fmt::print("film: {}: {}\n", request.file, world.lacks());
  const double from_s = std::clamp(request.from_s.value_or(world.from_s()), world.from_s(), world.to_s());
  const double to_s = std::clamp(request.to_s.value_or(world.to_s()), world.from_s(), world.to_s());
  if (to_s < from_s) throw Error(ExitCode::usage, fmt::format("--to {} is before --from {}", to_s, from_s));
  std::optional<Camera> camera = camera_of(request);
  std::optional<double> line_m_per_n_s;
  const double interval_s = request.speed / request.rate_hz;
  const auto frames = static_cast<std::size_t>(std::floor((to_s - from_s) / interval_s + 1e-9)) + 1;
  make_folder(request.out);
  std::vector<std::filesystem::path> files{request.out + "/film.mp4"};
  for (std::size_t i = 0; i < frames; ++i) files.emplace_back(fmt::format("{}/frame_{:06d}.png", request.out, i));
  check_results(request.out, files);
  const Moments moments{from_s, interval_s, frames};
  if (!camera) camera = camera_of_all(world, moments, request.size);
  for (std::size_t i = 0; i < frames; ++i) {
    world.show(moments[i]);
    const Drawing drawing = draw({.bodies = world.scene().bodies,
                                  .states = world.states(),
                                  .meshes = world.scene().meshes,
                                  .users = world.users(),
                                  .camera = camera,
                                  .line_m_per_n_s = line_m_per_n_s,
                                  .joints = world.scene().joints,
                                  .broken_joints = world.broken_joints()},
                                 request.size);
    if (drawing.line_m_per_n_s > 0.0) line_m_per_n_s = drawing.line_m_per_n_s;
    write_png(files[i + 1], drawing.image, kOwnMark);
  }
  fmt::print("film: {} pictures of t = {:.3f} to {:.3f} s in {}/frame_*.png\n", frames, from_s, moments[frames - 1],
             request.out);
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
