#include "world_view.hpp"

#include "wire/codec/schema.hpp"

#include <cstring>
#include <string_view>

namespace subworld::live {
namespace {

constexpr double kMostBytes_s = 4e6;

constexpr std::string_view kPlaced =
    "@final struct Placed {\n  unsigned long body;\n  float x;\n  float y;\n  float z;\n  float qx;\n  float qy;\n"
    "  float qz;\n  float speed;\n};\n";

Placed placed(const StampedBody& one) {
  const Vec3& at = one.state.position;
  const Quat& turn = one.state.orientation;
  const double sign = turn.w() < 0.0 ? -1.0 : 1.0;
  const auto number = [](double value) { return static_cast<float>(value); };
  return {.body = index(one.id),
          .x = number(at.x()),
          .y = number(at.y()),
          .z = number(at.z()),
          .qx = number(sign * turn.x()),
          .qy = number(sign * turn.y()),
          .qz = number(sign * turn.z()),
          .speed = number(one.state.linear_velocity.norm())};
}

}  // namespace

std::string world_view_schema() {
  constexpr std::string_view kState = "@final struct WorldState {", kView = "@final struct WorldView {";
  std::string schema = schema_of(wire_idl(), "WorldState");
  const std::size_t at = schema.find(kState);
  schema.insert(schema.find("};", at), "  sequence<Placed> placed;\n");
  return schema.replace(at, kState.size(), std::string(kPlaced) + std::string(kView));
}

void WorldViewer::take(std::span<const std::uint8_t> cdr, std::size_t bodies) {
  if (!codec_.decode(cdr, snapshot_)) return;
  changed_ = true;
  for (const StampedBody& one : snapshot_.moved)
    if (index(one.id) < bodies) moved_.insert_or_assign(one.id, placed(one));
}

std::optional<std::vector<std::uint8_t>> WorldViewer::make(std::uint64_t now_ns) {
  if (!changed_ || now_ns < next_ns_) return std::nullopt;
  changed_ = false;
  snapshot_.moved.clear();
  const auto head = codec_.encode(snapshot_);
  std::vector<std::uint8_t> cdr(head.begin(), head.end());
  while (cdr.size() % sizeof(std::uint32_t) != 0) cdr.push_back(0);
  const auto count = static_cast<std::uint32_t>(moved_.size());
  const std::size_t at = cdr.size();
  cdr.resize(at + sizeof count + count * sizeof(Placed));
  std::memcpy(cdr.data() + at, &count, sizeof count);
  std::uint8_t* to = cdr.data() + at + sizeof count;
  for (const auto& [id, row] : moved_) {
    std::memcpy(to, &row, sizeof row);
    to += sizeof row;
  }
  moved_.clear();
  next_ns_ = now_ns + static_cast<std::uint64_t>(1e9 * static_cast<double>(cdr.size()) / kMostBytes_s);
  return cdr;
}

}  // namespace subworld::live
