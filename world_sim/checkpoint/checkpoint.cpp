#include "world_sim/checkpoint/checkpoint.hpp"

#include "model/error.hpp"
#include "model/hash.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <type_traits>
#include <utility>

namespace subworld {

namespace {

static_assert(std::endian::native == std::endian::little, "the file is little-endian");

constexpr std::string_view kMagic = "SUBWORLDCHECKPNT";
constexpr std::uint64_t kVersion = 3;
constexpr std::size_t kLengthAt = kMagic.size() + sizeof(kVersion);
constexpr std::size_t kHeadBytes = kLengthAt + sizeof(std::uint64_t), kSumBytes = sizeof(std::uint64_t);
constexpr double kUnit = 1e-3;  ///< by which the norm of an orientation may differ from 1

constexpr const char* kCure = "resume from an older checkpoint, or start the run anew without --resume";

std::uint64_t sum_of(std::string_view bytes) noexcept {
  std::uint64_t sum = kHashSeed;
  for (const char c : bytes) sum = hashed(sum, static_cast<unsigned char>(c));
  return sum;
}

/// The members of a checkpoint in the order of the file; `visit(member)` for each.
template <class Checkpoint, class Visit>
void each_member(Checkpoint& c, Visit&& visit) {
  visit(c.settings);
  visit(c.engine);
  visit(c.session);
  visit(c.stamp);
  visit(c.haptic_steps);
  visit(c.time_s);
  visit(c.ratio);
  visit(c.planned.stamp);
  visit(c.planned.ratio);
  visit(c.ratio_changes);
  visit(c.state_hash);
  visit(c.kinetic_j);
  visit(c.potential_j);
  visit(c.energy_excess_j);
  visit(c.released_j);
  visit(c.operators_created_j);
  visit(c.states);
  visit(c.asleep);
  visit(c.devices);
  visit(c.broken_joints);
  visit(c.absences);
}

std::array<double, 7> numbers_of(const Pose& pose) {
  const auto& [p, q] = pose;
  return {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()};
}

Pose pose_of(const std::array<double, 7>& n) { return {{n[0], n[1], n[2]}, {n[3], n[4], n[5], n[6]}}; }

std::array<double, 13> numbers_of(const BodyState& s) {
  const auto& [p, q, v, w] = s;
  return {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z(), v.x(), v.y(), v.z(), w.x(), w.y(), w.z()};
}

BodyState state_of(const std::array<double, 13>& n) {
  return {{n[0], n[1], n[2]}, {n[3], n[4], n[5], n[6]}, {n[7], n[8], n[9]}, {n[10], n[11], n[12]}};
}

class Encoder {
 public:
  explicit Encoder(std::string& bytes) : bytes_(bytes) {}
  template <class T>
  requires std::is_arithmetic_v<T>
  void operator()(const T& number) {
    char raw[sizeof(T)];
    std::memcpy(raw, &number, sizeof(T));
    bytes_.append(raw, sizeof(T));
  }
  void operator()(const std::string& text) {
    (*this)(std::uint64_t{text.size()});
    bytes_ += text;
  }
  void operator()(const NamedSetting& setting) {
    (*this)(setting.name);
    (*this)(setting.value);
  }
  void operator()(const BodyState& state) {
    for (const double number : numbers_of(state)) (*this)(number);
  }
  void operator()(const Pose& pose) {
    for (const double number : numbers_of(pose)) (*this)(number);
  }
  void operator()(const Absence& one) {
    (*this)(std::uint64_t{one.user});
    (*this)(one.from_s);
    (*this)(one.to_s);
    (*this)(static_cast<std::uint8_t>(one.by_order));
  }
  template <class T>
  void operator()(const std::vector<T>& list) {
    (*this)(std::uint64_t{list.size()});
    for (const T& item : list) (*this)(item);
  }

 private:
  std::string& bytes_;
};

/// Throws `const char*`: what is wrong.
class Decoder {
 public:
  explicit Decoder(std::string_view bytes) : rest_(bytes) {}
  [[nodiscard]] bool done() const noexcept { return rest_.empty(); }

  template <class T>
  requires std::is_arithmetic_v<T>
  void operator()(T& number) { std::memcpy(&number, next(sizeof(T)).data(), sizeof(T)); }
  void operator()(std::string& text) { text = next(length(1)); }
  void operator()(NamedSetting& setting) {
    (*this)(setting.name);
    (*this)(setting.value);
  }
  void operator()(BodyState& state) {
    std::array<double, 13> numbers{};
    for (double& number : numbers) (*this)(number);
    state = state_of(numbers);
  }
  void operator()(Pose& pose) {
    std::array<double, 7> numbers{};
    for (double& number : numbers) (*this)(number);
    pose = pose_of(numbers);
  }
  void operator()(Absence& one) {
    std::uint64_t user = 0;
    std::uint8_t by_order = 0;
    (*this)(user);
    (*this)(one.from_s);
    (*this)(one.to_s);
    (*this)(by_order);
    if (by_order > 1) throw "holds an impossible flag";
    one.user = user;
    one.by_order = by_order == 1;
  }
  template <class T>
  void operator()(std::vector<T>& list) {
    list.resize(length(smallest<T>()));
    for (T& item : list) (*this)(item);
  }

 private:
  /// Bytes of an item at least: bounds what a length may claim, before memory is taken for it.
  template <class T>
  static constexpr std::size_t smallest() {
    if constexpr (std::is_same_v<T, BodyState>) return 13 * sizeof(double);
    if constexpr (std::is_same_v<T, Pose>) return 7 * sizeof(double);
    if constexpr (std::is_same_v<T, Absence>) return 3 * sizeof(double) + 1;
    if constexpr (std::is_same_v<T, NamedSetting>) return 2 * sizeof(std::uint64_t);
    return 1;
  }
  std::string_view next(std::size_t size) {
    if (size > rest_.size()) throw "ends within a value";
    const std::string_view taken = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return taken;
  }
  std::size_t length(std::size_t item_bytes) {
    std::uint64_t count = 0;
    (*this)(count);
    if (count > rest_.size() / item_bytes) throw "holds a length beyond its end";
    return count;
  }

  std::string_view rest_;
};

/// What is impossible in a checkpoint; empty: nothing.
const char* fault_in(const WorldCheckpoint& c) noexcept {
  for (const double number :
       {c.time_s, c.kinetic_j, c.potential_j, c.energy_excess_j, c.released_j, c.operators_created_j}) {
    if (!std::isfinite(number)) return "holds a time or an energy that is not finite";
  }
  if (c.time_s < 0.0) return "holds a time before t = 0";
  const auto possible = [](int ratio) { return ratio >= 1 && ratio <= kMostRatio; };
  if (!possible(c.ratio) || !possible(c.planned.ratio)) return "holds an impossible simulation ratio";
  constexpr std::uint64_t kMostStamps = std::uint64_t{1} << 48U;
  if (c.stamp > kMostStamps || c.planned.stamp > kMostStamps || c.haptic_steps > kMostStamps * kMostRatio)
    return "holds an impossible stamp";
  if (c.states.size() != c.asleep.size()) return "holds another number of bodies than of their states";
  for (const BodyState& state : c.states) {
    if (!finite(state)) return "holds a body state that is not finite";
    if (std::abs(state.orientation.norm() - 1.0) > kUnit) return "holds an orientation that is no unit quaternion";
  }
  for (const Pose& pose : c.devices) {
    if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite())
      return "holds a device pose that is not finite";
    if (std::abs(pose.orientation.norm() - 1.0) > kUnit) return "holds an orientation that is no unit quaternion";
  }
  for (const Absence& one : c.absences) {
    if (one.user >= c.devices.size()) return "holds an absence of a user that does not exist";
    if (!std::isfinite(one.from_s) || !std::isfinite(one.to_s)) return "holds an absence that is not finite";
  }
  return std::ranges::all_of(c.asleep, [](std::uint8_t flag) { return flag <= 1; }) ? nullptr
                                                                                    : "holds an impossible flag";
}

[[noreturn]] void refuse(const std::string& file, const std::string& what) {
  throw Error(ExitCode::failed, fmt::format("{}: {}; {}", file, what, kCure));
}

std::uint64_t number_at(std::string_view bytes, std::size_t at) noexcept {
  std::uint64_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof(number));
  return number;
}

WorldCheckpoint read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) refuse(path, fmt::format("the checkpoint cannot be opened: {}", std::strerror(errno)));
  const std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  if (file.bad()) refuse(path, "the checkpoint cannot be read");
  return decode_checkpoint(bytes, path);
}

struct Found {
  std::uint64_t number = 0;
  WorldCheckpoint checkpoint;
};

/// The newest valid one of a folder; empty: there is none.
std::optional<Found> newest_in(const std::string& folder, std::vector<std::string>& skipped) {
  std::optional<Found> newest;
  for (std::uint64_t number = 0; number < 2; ++number) {
    const std::string path = checkpoint_file(folder, number);
    if (!std::filesystem::exists(path)) continue;
    try {
      WorldCheckpoint one = read_file(path);
      if (!newest || one.stamp > newest->checkpoint.stamp) newest = {number, std::move(one)};
    } catch (const Error& wrong) {
      skipped.emplace_back(wrong.what());
    }
  }
  return newest;
}

WorldCheckpoint read_folder(const std::string& folder, std::vector<std::string>& skipped) {
  if (auto newest = newest_in(folder, skipped)) return std::move(newest->checkpoint);
  throw Error(ExitCode::failed,
              skipped.empty()
                  ? fmt::format("--resume {}: holds no checkpoint; runs in real time with --out write them, unless "
                                "with --checkpoint 0",
                                folder)
                  : fmt::format("--resume {}: holds no valid checkpoint; {}", folder, skipped.front()));
}

}  // namespace

void seal_checkpoint(std::string& bytes) {
  if (bytes.size() < kHeadBytes + kSumBytes) return;
  const std::uint64_t length = bytes.size();
  std::memcpy(bytes.data() + kLengthAt, &length, sizeof(length));
  const std::uint64_t sum = sum_of(std::string_view(bytes).substr(0, bytes.size() - kSumBytes));
  std::memcpy(bytes.data() + bytes.size() - kSumBytes, &sum, kSumBytes);
}

void encode(const WorldCheckpoint& checkpoint, std::string& bytes) {
  bytes.assign(kMagic);
  Encoder encoder(bytes);
  encoder(kVersion);
  encoder(std::uint64_t{0});
  each_member(checkpoint, encoder);
  encoder(std::uint64_t{0});
  seal_checkpoint(bytes);
}

WorldCheckpoint decode_checkpoint(std::string_view bytes, const std::string& file) {
  if (bytes.size() < kHeadBytes + kSumBytes || !bytes.starts_with(kMagic)) refuse(file, "is no checkpoint of a world");
  if (const std::uint64_t version = number_at(bytes, kMagic.size()); version != kVersion)
    refuse(file, fmt::format("is a checkpoint of format {}, and this program reads format {}", version, kVersion));
  if (const std::uint64_t length = number_at(bytes, kLengthAt); length != bytes.size())
    refuse(file, fmt::format("the checkpoint has {} bytes, not the {} that it was written with", bytes.size(), length));
  const std::string_view sealed = bytes.substr(0, bytes.size() - kSumBytes);
  if (number_at(bytes, sealed.size()) != sum_of(sealed))
    refuse(file, "the checkpoint is damaged: its checksum differs");
  WorldCheckpoint checkpoint;
  try {
    Decoder decoder(sealed.substr(kHeadBytes));
    each_member(checkpoint, decoder);
    if (!decoder.done()) throw "holds more than its values";
  } catch (const char* wrong) {
    refuse(file, fmt::format("the checkpoint {}", wrong));
  }
  if (const char* const wrong = fault_in(checkpoint)) refuse(file, fmt::format("the checkpoint {}", wrong));
  return checkpoint;
}

std::string checkpoint_file(const std::string& folder, std::uint64_t number) {
  return fmt::format("{}/world_{}.checkpoint", folder, number % 2);
}

std::uint64_t next_checkpoint(const std::string& folder) {
  std::vector<std::string> skipped;
  const auto newest = newest_in(folder, skipped);
  return newest ? newest->number + 1 : 0;
}

WorldCheckpoint read_checkpoint(const std::string& path, const Scene& scene, std::vector<std::string>& skipped) {
  WorldCheckpoint checkpoint = std::filesystem::is_directory(path) ? read_folder(path, skipped) : read_file(path);
  if (const std::string text = difference(agreed_settings(scene), checkpoint.settings, 3, "in the checkpoint");
      !text.empty()) {
    throw Error(ExitCode::usage,
                fmt::format("--resume {}: a checkpoint of another scene or of other settings: {}; give "
                            "the scene and the flags of that run",
                            path, text));
  }
  if (checkpoint.states.size() != scene.bodies.size())
    refuse(path,
           fmt::format("the checkpoint has {} bodies, the scene {}", checkpoint.states.size(), scene.bodies.size()));
  if (checkpoint.devices.size() != scene.users.size())
    refuse(path, fmt::format("the checkpoint has {} users, the run {}", checkpoint.devices.size(), scene.users.size()));
  return checkpoint;
}

Scene resumed_scene(const Scene& scene, const WorldCheckpoint& checkpoint) {
  Scene resumed = scene;
  resumed.initial = checkpoint.states;
  for (Body& body : resumed.bodies) body.at_rest = checkpoint.asleep[index(body.id)] != 0;
  for (UserSpec& user : resumed.users) user.joins_late = false;  // every proxy is there
  return resumed;
}

}  // namespace subworld
