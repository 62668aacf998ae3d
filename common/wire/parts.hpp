#pragma once

#include "model/exchange.hpp"

#include <subworld.h>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

/// Conversion of the nested types of topics; only `convert.cpp` needs it. `get` returns false for invalid contents and
/// may then leave `out` half filled.
namespace subworld::parts {

void put(const Vec3& in, msg::Vector& out);
void put(const Quat& in, msg::Quaternion& out);
void put(BodyId in, std::uint32_t& out);
void put(const Pose& in, msg::Pose& out);
void put(const Wrench& in, msg::Wrench& out);
void put(BodyId id, const BodyState& in, msg::State& out);
void put(const StampedBody& in, msg::State& out);
void put(const std::array<std::uint32_t, 3>& in, msg::Triangle& out);
void put(const Vec3& in, msg::Point& out);
void put(const Mesh& in, msg::Mesh& out);
void put(const Body& in, msg::Body& out);
void put(const EnteringBody& in, msg::EnteringBody& out);
void put(const BoundaryContact& in, msg::BoundaryContact& out);
void put(const Eigen::Matrix3d& in, msg::SymmetricTensor& out);
void put(const CarriedBody& in, msg::CarriedBody& out);
void put(const GhostAxis& in, msg::GhostAxis& out);
/// Also fills the frame's flat sequences: axes and carried bodies.
void put_ghosts(const std::vector<GhostModel>& in, msg::WorldFrame& out);
void put(const PeerDevice& in, msg::PeerDevice& out);
void put(const Suppression& in, msg::Suppression& out);
void put(const ReportedDevice& in, msg::ReportedDevice& out);
void put(const UserView& in, msg::UserView& out);

[[nodiscard]] bool get(double in, double& out);
[[nodiscard]] bool get_positive(double in, double& out);
[[nodiscard]] bool get_ratio(std::uint32_t in, int& out);
[[nodiscard]] bool get(const msg::Vector& in, Vec3& out);
[[nodiscard]] bool get(const msg::Quaternion& in, Quat& out);
[[nodiscard]] bool get(std::uint32_t in, BodyId& out);
[[nodiscard]] bool get(const msg::Pose& in, Pose& out);
[[nodiscard]] bool get(const msg::Wrench& in, Wrench& out);
[[nodiscard]] bool get(const msg::State& in, BodyState& out);
[[nodiscard]] bool get(const msg::State& in, StampedBody& out);
[[nodiscard]] bool get(const msg::Triangle& in, std::array<std::uint32_t, 3>& out);
[[nodiscard]] bool get(const msg::Point& in, Vec3& out);
[[nodiscard]] bool get(const msg::Mesh& in, Mesh& out);
[[nodiscard]] bool get(const msg::Body& in, Body& out);
[[nodiscard]] bool get(const msg::EnteringBody& in, EnteringBody& out);
[[nodiscard]] bool get(const msg::BoundaryContact& in, BoundaryContact& out);
[[nodiscard]] bool get(const msg::SymmetricTensor& in, Eigen::Matrix3d& out);
[[nodiscard]] bool get(const msg::CarriedBody& in, CarriedBody& out);
[[nodiscard]] bool get(const msg::GhostAxis& in, GhostAxis& out);
[[nodiscard]] bool get_ghosts(const msg::WorldFrame& in, std::vector<GhostModel>& out);
[[nodiscard]] bool get(const msg::PeerDevice& in, PeerDevice& out);
[[nodiscard]] bool get(const msg::Suppression& in, Suppression& out);
[[nodiscard]] bool get(const msg::ReportedDevice& in, ReportedDevice& out);
[[nodiscard]] bool get(const msg::UserView& in, UserView& out);

/// An optional value; a sequence of length 0 or 1 on the wire.
template <class In, class Out>
void put_one(const std::optional<In>& in, std::vector<Out>& out) {
  out.resize(in ? 1 : 0);
  if (in) put(*in, out.front());
}

template <class In, class Out>
[[nodiscard]] bool get_one(const std::vector<In>& in, std::optional<Out>& out) {
  out.reset();
  return in.empty() || (in.size() == 1 && get(in.front(), out.emplace()));
}

template <class In, class Out>
void put_all(const std::vector<In>& in, std::vector<Out>& out) {
  out.resize(in.size());
  for (std::size_t i = 0; i < in.size(); ++i) put(in[i], out[i]);
}

template <class In, class Out>
[[nodiscard]] bool get_all(const std::vector<In>& in, std::vector<Out>& out) {
  out.resize(in.size());
  for (std::size_t i = 0; i < in.size(); ++i) {
    if (!get(in[i], out[i])) return false;
  }
  return true;
}

}  // namespace subworld::parts
