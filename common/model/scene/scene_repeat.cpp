#include "model/scene/scene_reader.hpp"

#include <fmt/core.h>

namespace subworld {

namespace {

constexpr Limits kOffset{.least = -1e6, .most = 1e6};  // m
constexpr Limits kGap{.least = 0.0, .most = 1e6};      // m
const std::initializer_list<std::string_view> kForms = {"row", "grid", "stack", "heap", "card_house"};

GridLayout read_row(const YamlValue& value) {
  const YamlMap map(value, {"count", "step_m"});
  GridLayout grid;
  grid.counts[0] = map.at("count").integer(1, kMostBodies);
  grid.steps.col(0) = map.at("step_m").vec3(kOffset);
  return grid;
}

GridLayout read_grid(const YamlValue& value) {
  const YamlMap map(value, {"counts", "spacing_m", "odd_column_shift_m"});
  GridLayout grid;
  const YamlValue counts = map.at("counts");
  (void)counts.numbers(3);
  for (std::size_t i = 0; i < 3; ++i) grid.counts[i] = counts.items()[i].integer(1, kMostBodies);
  grid.steps = map.at("spacing_m").vec3(kOffset).asDiagonal();
  if (const auto shift = map.find("odd_column_shift_m")) grid.odd_column_shift = shift->vec3(kOffset);
  return grid;
}

GridLayout read_stack(const YamlValue& value, const SolidShape& solid) {
  const YamlMap map(value, {"count", "gap_m"});
  if (solid.shape.kind >= ShapeKind::convex) {
    value.fail("such a shape has no known height; use row with a step_m");
  }
  GridLayout grid;
  grid.counts[2] = map.at("count").integer(1, kMostBodies);
  double gap = 0.0;
  map.read("gap_m", gap, kGap);
  grid.steps(2, 2) = 2.0 * solid.half_extents.z() + gap;
  return grid;
}

HeapLayout read_heap(const YamlValue& value, const SolidShape& solid) {
  const YamlMap map(value, {"count", "area_m", "seed", "max_tilt_deg", "gap_m"});
  HeapLayout heap;
  heap.count = map.at("count").integer(1, kMostBodies);
  const std::vector<double> area = map.at("area_m").numbers(2, {.least = 0.0, .most = 1e6, .above = true});
  heap.area = {area[0], area[1]};
  heap.seed = static_cast<std::uint64_t>(map.at("seed").integer(0, 2'000'000'000));
  map.read("max_tilt_deg", heap.max_tilt_deg, {.least = 0.0, .most = 180.0});
  map.read("gap_m", heap.gap, kGap);
  // Copies are placed by the frame of the scene, which need not be the centre.
  const double off_m = solid.frame.position.norm();
  const Eigen::Matrix3d turn = solid.frame.orientation.toRotationMatrix();
  heap.half_extents = turn.cwiseAbs() * solid.half_extents + solid.frame.position.cwiseAbs();
  heap.bounding_radius = solid.bounding_radius + off_m;
  return heap;
}

CardHouseLayout read_card_house(const YamlValue& value, const SolidShape& solid) {
  const YamlMap map(value, {"stages", "lean_deg", "gap_m", "double_floors"});
  if (solid.shape.kind != ShapeKind::box) value.fail("a card is a box; set shape: box");
  CardHouseLayout house;
  house.card_size = 2.0 * solid.half_extents;
  house.stages = map.at("stages").integer(1, 200);
  map.read("lean_deg", house.lean_deg, {.least = 1.0, .most = 45.0});
  map.read("gap_m", house.gap, kGap);
  if (const auto floors = map.find("double_floors")) {
    for (const YamlValue& floor : floors->items()) {
      const int number = floor.integer(1, house.stages - 1);
      for (const int other : house.double_floors) {
        if (other == number) floor.fail("is twice in this list; remove one");
      }
      house.double_floors.push_back(number);
    }
  }
  if (!fits(house)) value.fail("neighbouring pairs overlap; use a smaller lean_deg or thinner cards");
  return house;
}

std::int64_t size(const GridLayout& grid) { return std::int64_t{grid.counts[0]} * grid.counts[1] * grid.counts[2]; }

}  // namespace

Layout BodyReader::read_repeat(const YamlMap& body, const SolidShape& solid) const {
  const YamlValue value = body.at("repeat");
  const YamlMap map(value, kForms);
  const std::string_view form = *(kForms.begin() + map.one_of(kForms));
  const YamlValue at = map.at(form);
  if (solid.shape.kind == ShapeKind::plane) value.fail("one plane is enough; remove it");
  if (form == "stack" || form == "heap" || form == "card_house") {
    body.forbid({"rotation"}, fmt::format("a {} turns its bodies itself", form));
  }
  const auto checked = [&](const auto& layout, std::int64_t count) {
    require_room(at, count);
    return lay_out(layout);
  };
  if (form == "heap") {
    const HeapLayout heap = read_heap(at, solid);
    Layout layout = checked(heap, heap.count);
    if (layout.empty()) at.fail("not one body fits area_m; make it larger than the body's diagonal");
    return layout;
  }
  if (form == "card_house") {
    const CardHouseLayout house = read_card_house(at, solid);
    return checked(house, card_count(house));
  }
  const GridLayout grid = form == "row" ? read_row(at) : form == "grid" ? read_grid(at) : read_stack(at, solid);
  return checked(grid, size(grid));
}

void BodyReader::require_room(const YamlValue& value, std::int64_t count) const {
  const auto present = static_cast<std::int64_t>(scene_.bodies.size());
  if (present + count > kMostBodies) {
    value.fail(fmt::format("{} bodies after {} others; a scene has at most {}", count, present, kMostBodies));
  }
}

}  // namespace subworld
