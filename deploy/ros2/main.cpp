// Shows a run to ROS 2, and takes devices from it: plain DDS with ROS 2's names and types.
#include "io/options/options.hpp"
#include "io/results/output.hpp"
#include "model/error.hpp"
#include "model/tool_link.hpp"
#include "ros2/rate_limit.hpp"
#include "ros2/ros.hpp"
#include "rt/stop.hpp"
#include "tools.hpp"
#include "wire/observer.hpp"

#include <arpa/inet.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <thread>

namespace {

using namespace subworld;
using ros2::Ros;
using SteadyClock = std::chrono::steady_clock;

struct Request {
  Options options;
  int ros_domain = 0;
  std::vector<int> driven;  ///< users
  int first_port = 47800;   ///< of the device udp of user 0
  double rate_hz = 1000.0;  ///< of wrenches and poses, at most
};

/// A user's force and pose for ROS 2, and the poses of ROS 2 for the user's device `udp`.
class UserBridge {
 public:
  UserBridge(const Bus& bus, Ros& ros, int user, double rate_hz, std::optional<int> port)
      : wrench_rate_(rate_hz),
        pose_rate_(rate_hz),
        commands_(bus, device_partition(user)),
        states_(bus, device_partition(user)),
        wrenches_(ros.writer<ros2::WrenchStamped>(topic(user, "wrench"))),
        poses_(ros.writer<ros2::PoseStamped>(topic(user, "pose"))) {
    if (!port) return;
    moves_ = ros.reader<ros2::PoseStamped>(topic(user, "command_pose"));
    socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    to_.sin_family = AF_INET;
    to_.sin_port = htons(static_cast<std::uint16_t>(*port));
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  }
  ~UserBridge() {
    if (socket_ >= 0) close(socket_);
  }
  UserBridge(const UserBridge&) = delete;
  UserBridge& operator=(const UserBridge&) = delete;

  /// Returns whether the run is over for this user.
  bool pass() {
    while (commands_.take(command_))
      if (wrench_rate_.passes(SteadyClock::now()))
        wrenches_.write({ros2::header_of(command_.stamp_s), ros2::to_ros(command_.wrench.force),
                         ros2::to_ros(command_.wrench.torque)});
    while (states_.take(state_))
      if (pose_rate_.passes(SteadyClock::now()))
        poses_.write({ros2::header_of(command_.stamp_s), ros2::to_ros(state_.pose.position, state_.pose.orientation)});
    if (moves_) drive();
    return command_.last;
  }

 private:
  static std::string topic(int user, const char* name) { return fmt::format("subworld/user_{}/{}", user, name); }

  void drive() {
    std::uint64_t writer = 0;
    while (moves_->take(bytes_, writer)) {
      ros2::PoseStamped move;
      Changes changes;
      CdrReader archive(bytes_, changes);
      if (!archive.is_plain() || !fields(archive, move)) continue;
      const auto& [p, q] = move.pose;
      PoseDatagram pose{.mark = kPoseMark,
                        .number = ++number_,
                        .time_s = std::chrono::duration<double>(SteadyClock::now().time_since_epoch()).count(),
                        .position_m = {p.x, p.y, p.z},
                        .orientation = {q.w, q.x, q.y, q.z},
                        .linear_velocity_m_s = {},
                        .angular_velocity_rad_s = {},
                        .buttons = 0,
                        .flags = 0};
      (void)sendto(socket_, &pose, sizeof pose, 0, reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
    }
  }

  ros2::RateLimit wrench_rate_, pose_rate_;
  Watched<DeviceCommand> commands_;
  Watched<DeviceState> states_;
  Ros::Writer<ros2::WrenchStamped> wrenches_;
  Ros::Writer<ros2::PoseStamped> poses_;
  std::unique_ptr<wire::BackendReader> moves_;
  std::vector<std::uint8_t> bytes_;
  DeviceCommand command_;
  DeviceState state_;
  sockaddr_in to_{};
  int socket_ = -1;
  std::uint32_t number_ = 0;
};

/// The bodies for ROS 2, as the world describes them 60 times a second.
class WorldBridge {
 public:
  WorldBridge(const Bus& bus, Ros& ros, const Scene& scene)
      : scene_(scene),
        snapshots_(bus, {}),
        clock_(ros.writer<ros2::Clock>("clock")),
        transforms_(ros.writer<ros2::TFMessage>("tf")),
        joints_(ros.writer<ros2::JointState>("joint_states")),
        markers_(ros.writer<ros2::MarkerArray>("subworld/markers")) {
    for (const Body& body : scene.bodies)
      if (index(body.id) < scene.initial.size()) states_[index(body.id)] = scene.initial[index(body.id)];
  }

  /// Returns whether the world has been heard.
  bool pass() {
    constexpr double kMarkersEvery_s = 0.1;
    while (snapshots_.take(snapshot_)) {
      const double now_s = snapshot_.stamp_s;
      clock_.write({ros2::time_of(now_s)});
      ros2::TFMessage moved;
      for (const StampedBody& one : snapshot_.moved) {
        if (index(one.id) >= scene_.bodies.size()) continue;
        states_[index(one.id)] = one.state;
        moved.transforms.push_back({ros2::header_of(now_s), scene_.bodies[index(one.id)].name,
                                    ros2::to_ros(one.state.position), ros2::to_ros(one.state.orientation)});
      }
      transforms_.write(moved);
      if (!scene_.joints.empty()) joints_.write(joint_states(now_s));
      if (now_s - marked_s_ < kMarkersEvery_s && now_s >= marked_s_) continue;
      marked_s_ = now_s;
      markers_.write(marks(now_s));
    }
    return !snapshot_.moved.empty() || snapshot_.sequence > 0;
  }

 private:
  /// The free coordinates of all joints. A joint with several has the name and the coordinate's: "arm_x", "arm_turn_z".
  [[nodiscard]] ros2::JointState joint_states(double now_s) const {
    constexpr std::array kNames{"x", "y", "z", "turn_x", "turn_y", "turn_z"};
    ros2::JointState all{.header = ros2::header_of(now_s), .name = {}, .position = {}, .velocity = {}, .effort = {}};
    for (const Joint& joint : scene_.joints) {
      const BodyState &a = states_.at(index(joint.a)), &b = states_.at(index(joint.b));
      const JointPlace place = place_of(joint, {a.position, a.orientation}, {b.position, b.orientation});
      const auto at_point = [&](const BodyState& body) -> Vec3 {
        return body.linear_velocity + body.angular_velocity.cross(place.point - body.position);
      };
      const bool one = std::ranges::count(joint.axes, true, &JointAxis::free) == 1;
      for (std::size_t i = 0; i < kNames.size(); ++i) {
        if (!joint.axes[i].free) continue;
        const Vec3 rate = i < 3 ? Vec3(at_point(a) - at_point(b)) : Vec3(a.angular_velocity - b.angular_velocity);
        all.name.push_back(one ? joint.name : fmt::format("{}_{}", joint.name, kNames[i]));
        all.position.push_back(place.coordinates[i]);
        all.velocity.push_back(place.directions[i].dot(rate));
      }
    }
    return all;
  }

  [[nodiscard]] ros2::MarkerArray marks(double now_s) const {
    ros2::MarkerArray all;
    for (const auto& [id, state] : states_) {
      const Body& body = scene_.bodies[id];
      ros2::Marker mark{.header = ros2::header_of(now_s), .ns = "subworld"};
      mark.id = static_cast<std::int32_t>(id);
      mark.pose = ros2::to_ros(state.position, state.orientation);
      mark.color = body.fixed() ? ros2::ColorRGBA{0.6F, 0.6F, 0.6F, 1.0F} : ros2::ColorRGBA{0.3F, 0.5F, 0.8F, 1.0F};
      if (give_shape(body.shape, mark)) all.markers.push_back(std::move(mark));
    }
    return all;
  }

  /// False where there is nothing to show: a half-space has no end.
  bool give_shape(const Shape& shape, ros2::Marker& mark) const {
    const double across_m = 2.0 * shape.radius;
    switch (shape.kind) {
      case ShapeKind::plane:
        return false;
      case ShapeKind::sphere:
        mark.type = ros2::Marker::sphere, mark.scale = {across_m, across_m, across_m};
        return true;
      case ShapeKind::box:
        mark.scale = ros2::to_ros(Vec3(2.0 * shape.half_extents));
        return true;
      case ShapeKind::capsule:
      case ShapeKind::cylinder: {
        const double caps_m = shape.kind == ShapeKind::capsule ? across_m : 0.0;
        mark.type = ros2::Marker::cylinder, mark.scale = {across_m, across_m, 2.0 * shape.half_length + caps_m};
        return true;
      }
      case ShapeKind::convex:
      case ShapeKind::mesh:
      case ShapeKind::compound:
        break;
    }
    if (shape.mesh >= scene_.meshes.size()) return false;
    const Mesh& mesh = scene_.meshes[shape.mesh];
    mark.type = ros2::Marker::triangle_list, mark.scale = {1.0, 1.0, 1.0};
    for (const auto& corners : mesh.triangles)
      for (const std::uint32_t corner : corners) mark.points.push_back(ros2::to_ros(mesh.vertices[corner]));
    return true;
  }

  const Scene& scene_;
  Watched<WorldSnapshot> snapshots_;
  Ros::Writer<ros2::Clock> clock_;
  Ros::Writer<ros2::TFMessage> transforms_;
  Ros::Writer<ros2::JointState> joints_;
  Ros::Writer<ros2::MarkerArray> markers_;
  WorldSnapshot snapshot_;
  std::map<std::size_t, BodyState> states_;
  double marked_s_ = -1.0;
};

void bridge(const Request& request) {
  const Scene scene = load_scene(request.options);
  for (const int user : request.driven) {
    if (user >= scene.settings.users)
      throw Error(ExitCode::usage, fmt::format("--drive {}: {} users take part", user, scene.settings.users));
  }
  const auto bus = open_bus(request.options.network, scene.settings, scene.settings.h_s, "subworld ros2");
  Ros ros(request.options.network, request.ros_domain);
  WorldBridge world(*bus, ros, scene);
  std::deque<UserBridge> users;
  for (int user = 0; user < scene.settings.users; ++user) {
    const bool driven = std::ranges::find(request.driven, user) != request.driven.end();
    users.emplace_back(*bus, ros, user, request.rate_hz,
                       driven ? std::optional(request.first_port + user) : std::nullopt);
  }
  Watched<Status> statuses(*bus, {});
  Status status;
  fmt::print("subworld ros2: domain {} for ROS 2, of the run {}; {} user{}\n", request.ros_domain,
             request.options.network.domain, users.size(), users.size() == 1 ? "" : "s");
  std::fflush(stdout);
  watch_stop_signals(kLongestEnd_s);
  constexpr std::chrono::microseconds kLook{500};
  const auto until = SteadyClock::now() + std::chrono::duration<double>(request.options.wait_s);
  constexpr std::chrono::milliseconds kLastCommands{300};  // after the world has ended
  auto end = SteadyClock::time_point::max();
  for (bool over = false; !over && SteadyClock::now() < end && stop_signal() == 0;) {
    while (statuses.take(status)) {
      const bool ends = status.program == ProgramKind::world_sim && status.state == kStoppingState;
      if (ends) end = std::min(end, SteadyClock::now() + kLastCommands);
    }
    if (!world.pass() && SteadyClock::now() > until)
      throw Error(
          ExitCode::middleware,
          fmt::format("no world on domain {} within {} s; give --domain, --dds and, where it has keys, --secure "
                      "as the run has them",
                      request.options.network.domain, request.options.wait_s));
    over = true;
    for (UserBridge& user : users) over &= user.pass();
    std::this_thread::sleep_for(kLook);
  }
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld ros2", about_tool("ros2"));
  Request request;
  std::vector<std::string> driven;
  add_run_options(line, request.options);
  add_dds(line, request.options.network.dds, {"fastdds", "cyclonedds"});
  add_domain(line, request.options.network.domain);
  line.add("--ros-domain", &request.ros_domain, "domain of ROS 2: its ROS_DOMAIN_ID").range(0, 232);
  line.add("--rate", &request.rate_hz, "wrenches and poses of each user, at most").range(1.0, 1000.0, "Hz");
  line.add("--drive", &driven, "users whose device `udp` follows subworld/user_U/command_pose, separated by commas")
      .check([](const std::string& text) {
        const bool number = !text.empty() && text.find_first_not_of("0123456789,") == std::string::npos;
        return number ? std::string() : "must be numbers of users, as in 0,1";
      })
      .otherwise("none");
  line.add("--port", &request.first_port, "UDP port of the device `udp` of user 0; the next users have the next ones")
      .range(1024, 65472);
  line.footer(
      "Examples:\n"
      "  subworld ros2 heap --domain 100\n"
      "  subworld ros2 press --domain 100 --drive 0");
  if (const auto code = line.parse(argc, argv)) return *code;
  for (const std::string& user : driven) request.driven.push_back(std::atoi(user.c_str()));
  bridge(request);
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld ros2", subworld::guarded("subworld ros2", [&] { return main_of(argc, argv); }));
}
