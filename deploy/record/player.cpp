#include "record/player.hpp"

#include "model/error.hpp"
#include "record/replay.hpp"
#include "wire/topics.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <string_view>
#include <thread>
#include <utility>

namespace subworld {

namespace {

constexpr std::string_view kEnds = "stopping";  // the end of the recorded run is not the end of the replay
constexpr std::size_t kSceneTopic = kTopicIndex<SceneDescription>, kSnapshotTopic = kTopicIndex<WorldSnapshot>,
                      kStatusTopic = kTopicIndex<Status>;

/// The row of a topic in the file, as "/status" or "/user_1/device_state"; none: it is not known here.
std::optional<std::size_t> row_of_topic(const std::string& topic) {
  const std::string name = topic.substr(topic.rfind('/') + 1);
  const auto at = std::ranges::find(kTopics, name, [](const TopicSpec& one) { return std::string(one.name); });
  if (at == kTopics.end()) return {};
  return static_cast<std::size_t>(at - kTopics.begin());
}

std::string partition_of(const std::string& topic) {
  const std::size_t end = topic.rfind('/');
  if (end == 0) return {};
  const std::string user = topic.substr(1, end - 1);  // user_1
  return topic.find("/device_") == end ? "device" + user.substr(user.rfind('_')) : user;
}

/// None where the text is anything but a number.
std::optional<double> number_in(const std::string& text) {
  double number = 0.0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, number);
  if (read.ec != std::errc{} || read.ptr != end) return {};
  return number;
}

}  // namespace

Player::Player(mcap::Reader& reader, Bus& bus, const Config& config)
    : reader_(reader),
      config_(config),
      orders_(bus.reader<Control>()),
      answers_(bus.writer<ControlReply>()),
      snapshots_(bus.writer<WorldSnapshot>()),
      statuses_(bus.writer<Status>()),
      paused_(config.paused) {
  open_channels(bus);
  publish_scene();
  move_to(config.from_s);
  publish_statuses();
}

void Player::publish_scene() {
  Codec<SceneDescription> codec;
  wire::BackendWriter* writer = nullptr;
  std::optional<double> from_s, to_s;
  for (std::size_t i = 0; i < reader_.chunks() && (scene_.bodies.empty() || !from_s); ++i) {
    const mcap::Chunk chunk = reader_.read_chunk(i);
    if (!from_s) from_s = time_of(chunk, false);
    for (const mcap::Message& message : chunk.messages) {
      const auto at = channels_.find(message.channel);
      if (at == channels_.end() || at->second.topic != kSceneTopic || !codec.decode(message.data, scene_)) continue;
      writer = at->second.writer.get();
    }
  }
  if (writer == nullptr) throw Error(ExitCode::usage, "the recording has no scene; record a run to its end");
  for (std::size_t i = reader_.chunks(); i-- > 0 && !to_s;) to_s = time_of(reader_.read_chunk(i), true);
  scene_.settings.push_back({"replay.from_s", fmt::format("{}", from_s.value_or(0.0))});
  scene_.settings.push_back({"replay.to_s", fmt::format("{}", to_s.value_or(0.0))});
  writer->write(codec.encode(scene_));
}

std::optional<double> Player::time_of(const mcap::Chunk& chunk, bool last) {
  std::optional<double> time_s;
  WorldSnapshot snapshot;
  for (const mcap::Message& message : chunk.messages) {
    const auto at = channels_.find(message.channel);
    if (at == channels_.end() || at->second.topic != kSnapshotTopic || !snapshot_codec_.decode(message.data, snapshot))
      continue;
    time_s = snapshot.stamp_s;
    if (!last) break;
  }
  return time_s;
}

void Player::open_channels(Bus& bus) {
  for (const auto& [id, topic] : reader_.topics()) {
    const std::optional<std::size_t> row = row_of_topic(topic);
    if (!row || *row == kTopicIndex<Control> || *row == kTopicIndex<ControlReply>) continue;
    Channel& channel = channels_[id];
    channel.topic = *row;
    // Snapshots and statuses have writers of their own, because some are made here.
    if (*row != kSnapshotTopic && *row != kStatusTopic)
      channel.writer = Observer::counterpart(bus, *row, partition_of(topic));
  }
}

bool Player::read_more() {
  WorldSnapshot decoded;
  while (due_.empty() && next_chunk_ < reader_.chunks()) {
    const mcap::Chunk chunk = reader_.read_chunk(next_chunk_++);
    for (const mcap::Message& message : chunk.messages) {
      const auto at = channels_.find(message.channel);
      if (at == channels_.end() || at->second.topic == kSceneTopic) continue;
      const bool snapshot = at->second.topic == kSnapshotTopic && snapshot_codec_.decode(message.data, decoded);
      if (snapshot) read_s_ = decoded.stamp_s;
      due_.push_back({message.channel, read_s_, {message.data.begin(), message.data.end()}, snapshot});
    }
  }
  return !due_.empty();
}

void Player::publish(Due& due) {
  Channel& channel = channels_.at(due.channel);
  if (channel.topic == kStatusTopic) {
    Status status;
    if (!status_codec_.decode(due.data, status) || status.state == kEnds) return;
    learn(status);
    statuses_.write(newest_statuses_.at({status.program, status.instance}));
    statuses_at_ = Clock::now();
  } else if (due.snapshot) {
    published_s_ = due.time_s;
    if (snapshot_codec_.decode(due.data, snapshot_)) {
      snapshots_.write(snapshot_);
      learn(snapshot_);
    }
  } else {
    channel.writer->write(due.data);
  }
  ++published_;
}

/// Begins before the moment with a snapshot of all bodies, and adds those that follow.
void Player::move_to(double time_s) {
  states_ = scene_.states;
  bool found = false;
  next_chunk_ = reader_.last_chunk_before(time_s - kCompleteSnapshot_s,
                                          [&](const mcap::Chunk& chunk) { return time_of(chunk, false); });
  due_.clear();
  read_s_ = 0.0;
  WorldSnapshot last;
  for (; read_more() && due_.front().time_s <= time_s; due_.pop_front()) {
    const Due& due = due_.front();
    Status status;
    if (channels_.at(due.channel).topic == kStatusTopic && status_codec_.decode(due.data, status) &&
        status.state != kEnds)
      learn(status);
    if (!due.snapshot || !snapshot_codec_.decode(due.data, last)) continue;
    found = true;
    learn(last);
  }
  published_s_ = found ? last.stamp_s : due_.empty() ? 0.0 : due_.front().time_s;
  snapshot_ = last;
  snapshot_.stamp_s = published_s_;
  if (found) {
    publish_snapshot();
    ++published_;
  }
  restart_clock();
}

void Player::learn(const WorldSnapshot& snapshot) {
  for (const StampedBody& moved : snapshot.moved)
    if (index(moved.id) < states_.size()) states_[index(moved.id)] = moved.state;
}

void Player::publish_snapshot() {
  snapshot_.moved.clear();
  for (std::uint32_t i = 0; i < states_.size(); ++i) snapshot_.moved.push_back({BodyId{i}, states_[i]});
  snapshots_.write(snapshot_);
}

/// The newest status of a program, as the replay shows it.
void Player::learn(const Status& status) {
  Status& newest = newest_statuses_[{status.program, status.instance}];
  newest = status;
  newest.paused = paused_;
  if (newest.program == ProgramKind::world_sim) newest.real_time_factor = config_.speed;
}

void Player::publish_statuses() {
  Status world;
  world.state = "running";
  newest_statuses_.try_emplace({ProgramKind::world_sim, 0}, world);
  for (auto& [program, status] : newest_statuses_) {
    learn(Status(status));
    statuses_.write(status);
  }
  statuses_at_ = Clock::now();
}

void Player::restart_clock() {
  clock_from_ = Clock::now();
  clock_from_s_ = published_s_;
}

void Player::execute(const Control& order) {
  ControlReply reply;
  reply.number = order.number;
  reply.answer.outcome = OrderState::done;
  const bool was_paused = std::exchange(paused_, order.verb != ControlVerb::resume);
  switch (order.verb) {
    case ControlVerb::pause:
      reply.answer.text = "paused";
      break;
    case ControlVerb::resume:
      reply.answer.text = "resumed";
      break;
    case ControlVerb::step: {
      for (bool stepped = false; !stepped && (!due_.empty() || read_more()); due_.pop_front()) {
        stepped = due_.front().snapshot;
        publish(due_.front());
      }
      reply.answer.text = fmt::format("one snapshot, to t = {:.3f} s, then paused", published_s_);
      break;
    }
    case ControlVerb::seek: {
      paused_ = was_paused;
      const std::optional<double> time_s = number_in(order.argument);
      if (time_s) move_to(*time_s);
      reply.answer = time_s ? OrderAnswer{OrderState::done, fmt::format("moved to t = {:.3f} s", published_s_)}
                            : OrderAnswer{OrderState::refused, "a moment in seconds is needed"};
      break;
    }
    case ControlVerb::set_speed: {
      paused_ = was_paused;
      const double speed = number_in(order.argument).value_or(0.0);
      const bool possible = speed >= kLeastReplaySpeed && speed <= kMostReplaySpeed;
      if (possible) config_.speed = speed;
      reply.answer = possible ? OrderAnswer{OrderState::done, fmt::format("speed {}", speed)}
                              : OrderAnswer{OrderState::refused, fmt::format("a speed from {} to {} is needed",
                                                                             kLeastReplaySpeed, kMostReplaySpeed)};
      break;
    }
    case ControlVerb::stop:
      stopped_ = true;
      reply.answer.text = "stopped";
      break;
    default:
      paused_ = was_paused;
      reply.answer = {OrderState::refused, "a replay has no engine, scheme or users to change"};
  }
  restart_clock();
  publish_statuses();
  answers_.write(reply);
}

bool Player::advance(double wait_s) {
  Control order;
  while (orders_.take(order) == Take::sample) execute(order);
  if (stopped_) return false;
  if (Clock::now() - statuses_at_ > std::chrono::seconds(1)) {  // as the programs do
    publish_statuses();
    if (paused_) publish_snapshot();  // for a viewer that has come since
  }
  if (!paused_) {
    const double now_s = clock_from_s_ + config_.speed * to_seconds(Clock::now() - clock_from_);
    while (!due_.empty() || read_more()) {
      if (due_.front().time_s > now_s) break;
      publish(due_.front());
      due_.pop_front();
    }
    if (due_.empty()) {
      if (!config_.stays) return false;
      paused_ = true;
      publish_statuses();
    } else {
      wait_s = std::min(wait_s, std::max(1e-4, (due_.front().time_s - now_s) / config_.speed));
    }
  }
  std::this_thread::sleep_for(std::chrono::duration<double>(wait_s));
  return true;
}

}  // namespace subworld
