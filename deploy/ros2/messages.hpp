#pragma once

#include "model/messages/message_fields.hpp"

#include <cstdint>
#include <string>
#include <vector>

/// Messages of ROS 2, after the public definitions of geometry_msgs, std_msgs, builtin_interfaces, tf2_msgs,
/// visualization_msgs and rosgraph_msgs (Humble and later). `fields` give the order of the members.
namespace subworld::ros2 {

struct Time {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
};
bool fields(auto& archive, Is<Time> auto& m) { return archive("sec", m.sec) && archive("nanosec", m.nanosec); }

struct Header {
  Time stamp;
  std::string frame_id;
};
bool fields(auto& archive, Is<Header> auto& m) { return archive("stamp", m.stamp) && archive("frame_id", m.frame_id); }

struct Vector3 {
  double x = 0.0, y = 0.0, z = 0.0;
};
bool fields(auto& archive, Is<Vector3> auto& m) { return archive("x", m.x) && archive("y", m.y) && archive("z", m.z); }

struct Quaternion {
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
};
bool fields(auto& archive, Is<Quaternion> auto& m) {
  return archive("x", m.x) && archive("y", m.y) && archive("z", m.z) && archive("w", m.w);
}

struct Pose {
  Vector3 position;
  Quaternion orientation;
};
bool fields(auto& archive, Is<Pose> auto& m) {
  return archive("position", m.position) && archive("orientation", m.orientation);
}

struct PoseStamped {
  static constexpr const char* kType = "geometry_msgs::msg::dds_::PoseStamped_";
  Header header;
  Pose pose;
};
bool fields(auto& archive, Is<PoseStamped> auto& m) { return archive("header", m.header) && archive("pose", m.pose); }

struct WrenchStamped {
  static constexpr const char* kType = "geometry_msgs::msg::dds_::WrenchStamped_";
  Header header;
  Vector3 force, torque;
};
bool fields(auto& archive, Is<WrenchStamped> auto& m) {
  return archive("header", m.header) && archive("force", m.force) && archive("torque", m.torque);
}

struct TransformStamped {
  Header header;
  std::string child_frame_id;
  Vector3 translation;
  Quaternion rotation;
};
bool fields(auto& archive, Is<TransformStamped> auto& m) {
  return archive("header", m.header) && archive("child_frame_id", m.child_frame_id) &&
         archive("translation", m.translation) && archive("rotation", m.rotation);
}

struct TFMessage {
  static constexpr const char* kType = "tf2_msgs::msg::dds_::TFMessage_";
  std::vector<TransformStamped> transforms;
};
bool fields(auto& archive, Is<TFMessage> auto& m) { return archive("transforms", m.transforms); }

struct Clock {
  static constexpr const char* kType = "rosgraph_msgs::msg::dds_::Clock_";
  Time clock;
};
bool fields(auto& archive, Is<Clock> auto& m) { return archive("clock", m.clock); }

struct JointState {
  static constexpr const char* kType = "sensor_msgs::msg::dds_::JointState_";
  Header header;
  std::vector<std::string> name;
  std::vector<double> position, velocity, effort;
};
bool fields(auto& archive, Is<JointState> auto& m) {
  return archive("header", m.header) && archive("name", m.name) && archive("position", m.position) &&
         archive("velocity", m.velocity) && archive("effort", m.effort);
}

struct ColorRGBA {
  float r = 0.0F, g = 0.0F, b = 0.0F, a = 1.0F;
};
bool fields(auto& archive, Is<ColorRGBA> auto& m) {
  return archive("r", m.r) && archive("g", m.g) && archive("b", m.b) && archive("a", m.a);
}

/// The members behind `points` are here for their places only: colours of points, texture, text and mesh are empty.
struct Marker {
  enum Type : std::int32_t { cube = 1, sphere = 2, cylinder = 3, triangle_list = 11 };
  Header header;
  std::string ns;
  std::int32_t id = 0, type = cube, action = 0;
  Pose pose;
  Vector3 scale;
  ColorRGBA color;
  std::vector<Vector3> points;
  Header texture_header;
  std::string none;
};
bool fields(auto& archive, Is<Marker> auto& m) {
  const Time forever;
  const std::uint8_t no = 0;
  const std::vector<std::uint8_t> nothing;
  return archive("header", m.header) && archive("ns", m.ns) && archive("id", m.id) && archive("type", m.type) &&
         archive("action", m.action) && archive("pose", m.pose) && archive("scale", m.scale) &&
         archive("color", m.color) && archive("lifetime", forever) && archive("frame_locked", no) &&
         archive("points", m.points) && archive("colors", nothing) && archive("texture_resource", m.none) &&
         archive("texture.header", m.texture_header) && archive("texture.format", m.none) &&
         archive("texture.data", nothing) && archive("uv_coordinates", nothing) && archive("text", m.none) &&
         archive("mesh_resource", m.none) && archive("mesh_file.filename", m.none) &&
         archive("mesh_file.data", nothing) && archive("mesh_use_embedded_materials", no);
}

struct MarkerArray {
  static constexpr const char* kType = "visualization_msgs::msg::dds_::MarkerArray_";
  std::vector<Marker> markers;
};
bool fields(auto& archive, Is<MarkerArray> auto& m) { return archive("markers", m.markers); }

}  // namespace subworld::ros2
