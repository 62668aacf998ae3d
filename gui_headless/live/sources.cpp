#include "sources.hpp"

#include "io/results/json.hpp"
#include "joint_marks.hpp"
#include "scene_update.hpp"
#include "tools.hpp"
#include "wire/codec/schema.hpp"
#include "world_view.hpp"
#include "written.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <span>
#include <string_view>
#include <utility>

namespace subworld::live {
namespace {

constexpr std::string_view kModule = "subworld::msg::", kWorldView = "subworld::msg::WorldView",
                           kPlace = "subworld::msg::ProgramPlace", kUpdate = "foxglove::SceneUpdate",
                           kMarks = "subworld::msg::JointMarks", kSceneTopic = "/scene", kPlaceTopic = "/program_place",
                           kJointsTopic = "/joints";
constexpr std::string_view kPlaceSchema =
    "module subworld {\nmodule msg {\n@final struct ProgramPlace {\n  @key unsigned long program;\n"
    "  @key unsigned long instance;\n  string dds;\n  string host;\n  string process;\n};\n};\n};\n";
constexpr std::string_view kMarksSchema =
    "module subworld {\nmodule msg {\n@final struct Vector {\n  double x;\n  double y;\n  double z;\n};\n"
    "@final struct Quaternion {\n  double w;\n  double x;\n  double y;\n  double z;\n};\n"
    "@final struct JointMark {\n  unsigned long joint;\n  octet form;\n  unsigned long at;\n  unsigned long along;\n"
    "  Vector point;\n  Quaternion turn;\n  double shift;\n  double radius;\n  double half_length;\n};\n"
    "@final struct JointMarks {\n  sequence<JointMark> marks;\n};\n};\n};\n";
constexpr std::string_view kVerdictSchema =
    "module subworld {\nmodule msg {\n@final struct Gate {\n  string name;\n  double value;\n  double bound;\n"
    "  boolean at_most;\n  string unit;\n  boolean ok;\n  boolean warning;\n  string missed_by;\n  string why;\n};\n"
    "@final struct Verdict {\n  string verdict;\n  sequence<Gate> gates;\n};\n};\n};\n";
constexpr double kMostUpdateBytes_s = 20e6;  // a large scene is sent at a lower rate
constexpr std::uint64_t kEvent = 1ULL << 63U;

template <class M>
Channel topic_channel(std::string topic, std::string partition = {}) {
  const TopicSpec& spec = kTopicOf<M>;
  return {0,
          std::move(topic),
          spec.type,
          schema_of(wire_idl(), std::string(spec.type).substr(kModule.size())),
          kTopicIndex<M>,
          std::move(partition)};
}

std::vector<Channel> all_channels(int users) {
  std::vector<Channel> channels{topic_channel<SceneDescription>(std::string(kSceneTopic)),
                                topic_channel<WorldSnapshot>("/world_state"),
                                {0, "/scene_update", std::string(kUpdate), std::string(scene_update_schema()), {}, {}},
                                {0, "/world_view", std::string(kWorldView), world_view_schema(), {}, {}},
                                topic_channel<Status>("/status"),
                                {0, std::string(kJointsTopic), std::string(kMarks), std::string(kMarksSchema), {}, {}},
                                {0, std::string(kPlaceTopic), std::string(kPlace), std::string(kPlaceSchema), {}, {}},
                                topic_channel<Control>("/control"),
                                topic_channel<ControlReply>("/control_reply")};
  for (int user = 0; user < users; ++user) {
    const std::string name = fmt::format("/user_{}/", user);
    channels.push_back(topic_channel<DeviceState>(name + "device_state", device_partition(user)));
    channels.push_back(topic_channel<DeviceCommand>(name + "device_command", device_partition(user)));
    channels.push_back(topic_channel<WorldFrame>(name + "world_frame", user_partition(user)));
    channels.push_back(topic_channel<HapticReport>(name + "haptic_report", user_partition(user)));
  }
  channels.push_back({0, std::string(kToolsTopic), "subworld::msg::Tools", Tools::schema(), {}, {}});
  channels.push_back({0, std::string(kVerdictTopic), "subworld::msg::Verdict", std::string(kVerdictSchema), {}, {}});
  for (std::size_t i = 0; i < channels.size(); ++i) channels[i].id = static_cast<std::uint32_t>(i + 1);
  return channels;
}

bool is_view(const Channel& channel) { return channel.type == kWorldView; }
bool is_update(const Channel& channel) { return channel.type == kUpdate; }
bool is_scene(const Channel& channel) { return channel.row == kTopicIndex<SceneDescription>; }
bool has_reader(const Channel& channel) {
  return (channel.row && !is_scene(channel)) || is_view(channel) || is_update(channel);
}
/// Whether each message counts, and none replaces an earlier one.
bool is_event(const Channel& channel) {
  return channel.row == kTopicIndex<Control> || channel.row == kTopicIndex<ControlReply>;
}

/// The key words of a sample; all programs of a run send little-endian.
std::uint64_t key_of(std::size_t row, std::span<const std::uint8_t> cdr) {
  constexpr std::size_t kHeader = 4;
  const std::size_t bytes = 4 * std::min<std::size_t>(kTopics[row].key_words, 2);
  std::uint64_t key = 0;
  if (cdr.size() < kHeader + bytes) return key;
  for (std::size_t i = 0; i < bytes; ++i) key |= static_cast<std::uint64_t>(cdr[kHeader + i]) << (8 * i);
  return key;
}

std::vector<std::uint8_t> encode_joints(const SceneDescription& scene) {
  return written([&](CdrWriter& cdr) {
    cdr.sequence("", joint_marks(scene.joints, scene.bodies, scene.meshes, {}),
                 [&](std::size_t, const JointMark& mark) {
                   cdr("", mark.joint);
                   cdr("", mark.form);
                   cdr("", mark.at);
                   cdr("", mark.along);
                   cdr("", mark.point);
                   cdr("", mark.turn);
                   for (const double length_m : {mark.shift, mark.radius, mark.half_length}) cdr("", length_m);
                 });
  });
}

Bytes shared(std::vector<std::uint8_t>&& cdr) {
  return std::make_shared<const std::vector<std::uint8_t>>(std::move(cdr));
}

}  // namespace

std::uint64_t wall_time_ns() noexcept {
  return static_cast<std::uint64_t>(
      std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count());
}

std::vector<std::uint8_t> encode_verdict(const std::string& summary_file) {
  const Json summary = read_json(summary_file);
  return written([&](CdrWriter& cdr) {
    cdr("", summary.at("verdict").get<std::string>());
    cdr.sequence("", summary.at("gates"), [&](std::size_t, const Json& gate) {
      cdr("", gate.at("name").get<std::string>());
      cdr("", gate.at("value").get<double>());
      cdr("", gate.at("bound").get<double>());
      cdr("", gate.at("at_most").get<bool>());
      cdr("", gate.at("unit").get<std::string>());
      cdr("", gate.at("ok").get<bool>());
      cdr("", gate.at("warning").get<bool>());
      for (const char* key : {"missed_by", "why"}) cdr("", gate.value(key, std::string()));
    });
  });
}

Sources::Sources(const Bus& bus, int users)
    : bus_(bus), channels_(all_channels(users)), forces_n_(static_cast<std::size_t>(users), Vec3::Zero()) {}

const Channel* Sources::channel(std::uint32_t id) const noexcept {
  return id >= 1 && id <= channels_.size() ? &channels_[id - 1] : nullptr;
}

void Sources::subscribe(const Channel& channel) {
  const auto [at, first] = open_.try_emplace(channel.id);
  Open& open = at->second;
  if (first && has_reader(channel)) {
    try {
      open.observer = Observer::reader(bus_, channel.row.value_or(kTopicIndex<WorldSnapshot>), channel.partition);
      for (int user = 0; is_update(channel) && user < static_cast<int>(forces_n_.size()); ++user)
        commands_.push_back(Observer::reader(bus_, kTopicIndex<DeviceCommand>, device_partition(user)));
    } catch (...) {
      open_.erase(at);
      if (is_update(channel)) commands_.clear();
      throw;
    }
  }
  if (first && is_update(channel) && scene_) {
    states_ = scene_->states;
    changed_ = true;
  }
  ++open.subscribers;
}

void Sources::unsubscribe(const Channel& channel) noexcept {
  const auto at = open_.find(channel.id);
  if (at == open_.end() || --at->second.subscribers > 0) return;
  open_.erase(at);
  if (is_update(channel)) commands_.clear();
}

std::vector<Sample> Sources::newest(const Channel& channel) const {
  std::vector<Sample> samples;
  if (const auto at = shown_.find(channel.topic); at != shown_.end())
    for (const auto& [key, sample] : at->second) samples.push_back(sample);
  if (const auto at = open_.find(channel.id); at != open_.end())
    for (const auto& [key, sample] : at->second.newest) samples.push_back(sample);
  std::ranges::sort(samples, {}, &Sample::time_ns);
  return samples;
}

void Sources::describe(std::shared_ptr<const SceneDescription> scene, const Deliver& deliver) {
  scene_ = std::move(scene);
  states_ = scene_->states;
  changed_ = true;
  Codec<SceneDescription> codec;
  const auto cdr = codec.encode(*scene_);
  show(kSceneTopic, {cdr.begin(), cdr.end()}, deliver);
  show(kJointsTopic, encode_joints(*scene_), deliver);
}

void Sources::place(ProgramKind program, std::uint32_t instance, const PeerProgram& peer, const Deliver& deliver) {
  std::vector<std::uint8_t> cdr = written([&](CdrWriter& archive) {
    archive("", static_cast<std::uint32_t>(program));
    archive("", instance);
    for (const std::string& text : {peer.dds, peer.host, peer.process}) archive("", text);
  });
  show(kPlaceTopic, std::move(cdr), deliver, static_cast<std::uint64_t>(program) << 32U | instance);
}

void Sources::show(std::string_view topic, std::vector<std::uint8_t> cdr, const Deliver& deliver, std::uint64_t key) {
  Sample& shown = shown_[std::string(topic)][key];
  if (shown.bytes && *shown.bytes == cdr) return;
  shown = {key, wall_time_ns(), shared(std::move(cdr))};
  for (const Channel& channel : channels_)
    if (channel.topic == topic) deliver(channel, shown);
}

bool Sources::verdict_is_awaited() const noexcept {
  return std::ranges::any_of(open_, [&](const auto& one) { return channels_[one.first - 1].topic == kVerdictTopic; });
}

void Sources::poll(const Deliver& deliver) {
  for (auto& [id, open] : open_) {
    if (!open.observer) continue;
    const Channel& channel = channels_[id - 1];
    if (channel.row)
      poll_topic(channel, open, deliver);
    else
      poll_made(channel, open, deliver);
  }
}

void Sources::poll_topic(const Channel& channel, Open& open, const Deliver& deliver) {
  std::map<std::uint64_t, Sample> arrived;
  const std::uint64_t now = wall_time_ns();
  std::vector<std::uint8_t> cdr;
  std::uint64_t writer = 0;
  while (open.observer->take(cdr, writer)) {
    const std::uint64_t key = is_event(channel) ? kEvent | events_++ : key_of(*channel.row, cdr);
    arrived[key] = {key, now, shared(std::exchange(cdr, {}))};
  }
  for (const auto& [key, sample] : arrived) {
    deliver(channel, sample);
    if (!is_event(channel)) open.newest[key] = sample;
  }
}

void Sources::poll_made(const Channel& channel, Open& open, const Deliver& deliver) {
  std::vector<std::uint8_t> cdr;
  std::uint64_t writer = 0;
  while (open.observer->take(cdr, writer)) {
    if (is_view(channel))
      viewer_.take(cdr, scene_ ? scene_->bodies.size() : 0);
    else
      take_states(cdr);
  }
  if (is_update(channel)) take_forces();
  const std::uint64_t now = wall_time_ns();
  std::optional<std::vector<std::uint8_t>> made = is_view(channel) ? viewer_.make(now) : make_scene_update(now);
  if (!made) return;
  open.newest[0] = {0, now, shared(std::move(*made))};
  deliver(channel, open.newest[0]);
}

void Sources::take_states(std::span<const std::uint8_t> cdr) {
  if (!codec_.decode(cdr, snapshot_)) return;
  changed_ = true;
  for (const StampedBody& moved : snapshot_.moved)
    if (index(moved.id) < states_.size()) states_[index(moved.id)] = moved.state;
}

void Sources::take_forces() {
  Codec<DeviceCommand> codec;
  DeviceCommand command;
  std::vector<std::uint8_t> cdr;
  std::uint64_t writer = 0;
  for (std::size_t user = 0; user < commands_.size(); ++user) {
    while (commands_[user]->take(cdr, writer)) {
      if (!codec.decode(cdr, command)) continue;
      changed_ |= command.wrench.force != forces_n_[user];
      forces_n_[user] = command.wrench.force;
    }
  }
}

std::optional<std::vector<std::uint8_t>> Sources::make_scene_update(std::uint64_t now_ns) {
  if (!changed_ || !scene_ || now_ns < next_update_ns_) return std::nullopt;
  changed_ = false;
  std::vector<std::uint8_t> bytes =
      scene_update(*scene_, states_, snapshot_.users, forces_n_, snapshot_.broken_joints, now_ns);
  next_update_ns_ = now_ns + static_cast<std::uint64_t>(1e9 * static_cast<double>(bytes.size()) / kMostUpdateBytes_s);
  return bytes;
}

}  // namespace subworld::live
