#pragma once

#include "model/types.hpp"
#include "ros2/messages.hpp"
#include "wire/codec/cdr.hpp"
#include "wire/plugin.hpp"

#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace subworld::ros2 {

inline constexpr const char* kFrame = "world";

/// What ROS 2 does is no event of the run.
class NoEvents final : public wire::EventSink {
 public:
  void report(wire::Event, std::uint64_t, const char*, const char*, const char*) noexcept override {}
  void wake() noexcept override {}
};

inline Time time_of(double s) {
  const double whole = std::floor(s);
  return {static_cast<std::int32_t>(whole), static_cast<std::uint32_t>((s - whole) * 1e9)};
}
inline Header header_of(double stamp_s) { return {time_of(stamp_s), kFrame}; }
inline Vector3 to_ros(const Vec3& v) { return {v.x(), v.y(), v.z()}; }
inline Quaternion to_ros(const Quat& q) { return {q.x(), q.y(), q.z(), q.w()}; }
inline Pose to_ros(const Vec3& position, const Quat& orientation) { return {to_ros(position), to_ros(orientation)}; }

/// The domain of ROS 2.
class Ros {
 public:
  Ros(const Network& network, int domain) {
    BusConfig config{.vendor = parse_vendor(network.dds), .domain = domain};
    config.interface_address = network.interface_address;
    config.peers = network.peers;
    config.participant_name = "subworld_ros2";
    backend_.reset(wire::load_plugin(config.vendor)(wire::prepare(config), events_));
  }

  template <class M>
  class Writer {
   public:
    explicit Writer(std::unique_ptr<wire::BackendWriter> writer) : writer_(std::move(writer)) {}
    void write(const M& message) {
      if (writer_->matched() == 0) return;
      CdrWriter archive(bytes_, changes_);
      fields(archive, message);
      writer_->write(archive.written());
    }

   private:
    std::unique_ptr<wire::BackendWriter> writer_;
    std::vector<std::uint8_t> bytes_;
    Changes changes_;
  };

  /// ROS 2's default quality of service is reliable, volatile, the last 10. A reader that asks for less matches too.
  template <class M>
  [[nodiscard]] Writer<M> writer(const std::string& topic) {
    return Writer<M>(backend_->create_writer(spec<M>(topic, Reliability::reliable)));
  }
  template <class M>
  [[nodiscard]] std::unique_ptr<wire::BackendReader> reader(const std::string& topic) {
    return backend_->create_reader(spec<M>(topic, Reliability::best_effort));
  }

 private:
  template <class M>
  wire::EndpointSpec spec(const std::string& topic, Reliability reliability) {
    const std::string& name = names_.emplace_back("rt/" + topic);
    wire::EndpointSpec made{};
    made.topic = {.name = name.c_str(),
                  .type = M::kType,
                  .key_words = 0,
                  .reliability = reliability,
                  .durability = Durability::volatile_,
                  .depth = 10,
                  .deadline = DeadlineKind::none,
                  .delayed = {}};
    made.qos.reliable = reliability == Reliability::reliable;
    made.qos.depth = made.topic.depth;
    made.qos.lease_s = std::numeric_limits<double>::infinity();  // as ROS 2
    return made;
  }

  std::deque<std::string> names_;
  NoEvents events_;
  std::unique_ptr<wire::Backend> backend_;
};

}  // namespace subworld::ros2
