#include "film/recorded_world.hpp"

#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace subworld {

namespace {

std::uint16_t channel_of(const mcap::Reader& reader, const std::string& topic) {
  const auto at = std::ranges::find(reader.topics(), topic, [](const auto& one) { return one.second; });
  return at == reader.topics().end() ? std::uint16_t{0} : at->first;
}

void move(std::vector<BodyState>& states, const WorldSnapshot& snapshot) {
  for (const StampedBody& moved : snapshot.moved) {
    if (index(moved.id) < states.size()) states[index(moved.id)] = moved.state;
  }
}

}  // namespace

RecordedWorld::RecordedWorld(const std::string& file) : reader_(file), channel_(channel_of(reader_, "/world_state")) {
  const std::uint16_t scene = channel_of(reader_, "/scene");
  Codec<SceneDescription> codec;
  for (std::size_t i = 0; i < reader_.chunks() && scene_.bodies.empty(); ++i) {
    const mcap::Chunk chunk = reader_.read_chunk(i);
    for (const mcap::Message& message : chunk.messages)
      if (message.channel == scene) (void)codec.decode(message.data, scene_);
  }
  std::optional<double> first;
  for (std::size_t i = 0; i < reader_.chunks() && !first; ++i) first = first_stamp(reader_.read_chunk(i));
  if (scene_.bodies.empty() || !first)
    throw Error(ExitCode::usage,
                fmt::format("{}: holds no state of the world; record a run of another length, and with "
                            "this version",
                            file));
  from_s_ = to_s_ = *first;
  WorldSnapshot snapshot;
  bool found = false;
  for (std::size_t i = reader_.chunks(); i-- > 0 && !found;) {
    const mcap::Chunk chunk = reader_.read_chunk(i);
    for (const mcap::Message& message : chunk.messages) {
      if (message.channel != channel_ || !codec_.decode(message.data, snapshot)) continue;
      to_s_ = std::max(to_s_, snapshot.stamp_s);
      found = true;
    }
  }
  restart(from_s_);
  show(from_s_);
}

std::optional<double> RecordedWorld::first_stamp(const mcap::Chunk& chunk) {
  WorldSnapshot snapshot;
  for (const mcap::Message& message : chunk.messages)
    if (message.channel == channel_ && codec_.decode(message.data, snapshot)) return snapshot.stamp_s;
  return {};
}

/// Begins with a chunk early enough that a snapshot of all bodies comes before the moment.
void RecordedWorld::restart(double time_s) {
  next_chunk_ = reader_.last_chunk_before(time_s - kCompleteSnapshot_s,
                                          [this](const mcap::Chunk& chunk) { return first_stamp(chunk); });
  read_.clear();
  before_ = {from_s_, scene_.states, {}};
  after_ = before_;
}

bool RecordedWorld::read_next() {
  while (read_.empty() && next_chunk_ < reader_.chunks()) {
    const mcap::Chunk chunk = reader_.read_chunk(next_chunk_++);
    WorldSnapshot snapshot;
    for (const mcap::Message& message : chunk.messages)
      if (message.channel == channel_ && codec_.decode(message.data, snapshot)) read_.push_back(snapshot);
  }
  if (read_.empty()) return false;
  before_ = after_;
  move(after_.states, read_.front());
  after_.time_s = read_.front().stamp_s;
  after_.users = std::move(read_.front().users);
  read_.pop_front();
  return true;
}

void RecordedWorld::show(double time_s) {
  if (time_s < before_.time_s) restart(time_s);
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

}  // namespace subworld
