#include "lab/engines/body_costs.hpp"

#include "io/results/json.hpp"
#include "lab/engines/run.hpp"
#include "model/error.hpp"
#include "model/scene/scene_layout.hpp"
#include "model/shapes/mass_properties.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr int kCounts[] = {10, 25, 50, 100, 200, 350, 500};
constexpr double kSide_m = 0.1;
constexpr double kMass_kg = 0.2;
constexpr double kSpacing_m = 3.0 * kSide_m;
constexpr double kBinSide_m = 0.13;  ///< times the cube root of the number of bodies
constexpr double kBinWall_m = 0.1;
constexpr double kBinHeight_m = 4.0;
constexpr int kBinParts = 5;  ///< its bodies: the floor and four walls
constexpr double kSettle_s = 2.0;
constexpr double kSettleStep_s = 0.004;
constexpr int kWarmUp = 20;
constexpr int kSteps = 500;

/// Adds bodies with consecutive ids.
class Builder {
 public:
  Builder(const std::string& engine, const std::string& preset) {
    EngineSettings settings;
    settings.name = engine;
    settings.preset = preset;
    engine_ = make_engine(settings, {});
  }
  void box(const Vec3& half, double mass_kg, const Pose& pose) {
    Body body;
    body.shape.kind = ShapeKind::box;
    body.shape.half_extents = half;
    body.mass = mass_kg;
    body.inertia = principal_inertia(body.shape, mass_kg);
    add(body, pose);
  }
  void floor() {
    Body body;
    body.shape.kind = ShapeKind::plane;
    add(body, {});
  }
  std::unique_ptr<Engine> take() { return std::move(engine_); }

 private:
  void add(Body& body, const Pose& pose) {
    body.id = BodyId{next_++};
    BodyState state;
    state.position = pose.position;
    state.orientation = pose.orientation;
    engine_->add(body, state);
  }
  std::unique_ptr<Engine> engine_;
  std::uint32_t next_ = 0;
};

const Vec3 kHalf = Vec3::Constant(0.5 * kSide_m);

std::unique_ptr<Engine> spaced(Builder builder, int count) {
  const int row = static_cast<int>(std::ceil(std::cbrt(count)));
  GridLayout grid;
  grid.counts = {row, row, row};
  grid.steps = kSpacing_m * Eigen::Matrix3d::Identity();
  const Layout places = lay_out(grid);
  for (int i = 0; i < count; ++i) builder.box(kHalf, kMass_kg, places[static_cast<std::size_t>(i)]);
  return builder.take();
}

/// The heap has not settled yet.
std::unique_ptr<Engine> dense(Builder builder, int count) {
  const double side = kBinSide_m * std::cbrt(count);
  builder.floor();
  for (const double sign : {-1.0, 1.0}) {
    const double off = sign * 0.5 * (side + kBinWall_m);
    const double half = 0.5 * side + kBinWall_m;
    builder.box({0.5 * kBinWall_m, half, 0.5 * kBinHeight_m}, 0.0,
                {Vec3(off, 0, 0.5 * kBinHeight_m), Quat::Identity()});
    builder.box({half, 0.5 * kBinWall_m, 0.5 * kBinHeight_m}, 0.0,
                {Vec3(0, off, 0.5 * kBinHeight_m), Quat::Identity()});
  }
  HeapLayout heap;
  heap.count = count;
  heap.area = {side, side};
  heap.seed = 1;
  heap.half_extents = kHalf;
  heap.bounding_radius = kHalf.norm();
  for (const Pose& place : lay_out(heap)) builder.box(kHalf, kMass_kg, place);
  return builder.take();
}

/// False if a signal requested a stop.
bool let_settle(Engine& engine) {
  for (double t = 0.0; t < kSettle_s; t += kSettleStep_s) {
    if (stop_signal() != 0) return false;
    engine.step(kSettleStep_s);
  }
  return true;
}

Json measured(Engine& engine) {
  for (int i = 0; i < kWarmUp; ++i) engine.step(kCostStep_s);
  Histogram wall, cpu;
  MeanMax contacts;
  for (int i = 0; i < kSteps; ++i) {
    const StepTime time = timed_step(engine, kCostStep_s);
    wall.add(time.wall_s);
    cpu.add(time.cpu_s);
    contacts.add(static_cast<double>(engine.contacts().size()));
  }
  return {{"contacts_mean", contacts.mean()},
          {"dt_s", kCostStep_s},
          {"steps", kSteps},
          {"step_s", quantiles(wall)},
          {"cpu_step_s", quantiles(cpu)}};
}

LineFit fit(const CostCurve& curve, const char* x) {
  LineFit line;
  for (const Json& row : curve.rows) line.add(number(row, x), number(row.at("cpu_step_s"), "mean"));
  return line;
}

}  // namespace

Rows body_costs(const std::string& engine, const std::string& preset,
                const std::function<void(const Json&)>& progress) {
  Rows rows;
  for (const char* arrangement : {kSpaced, kDense}) {
    for (const int count : kCounts) {
      const bool heap = arrangement == kDense;
      try {
        const auto world = heap ? dense({engine, preset}, count) : spaced({engine, preset}, count);
        if (heap && !let_settle(*world)) return rows;
        Json row{{"arrangement", arrangement}, {"engine", engine}, {"preset", preset}, {"bodies", count}};
        row.update(measured(*world));
        const int last = heap ? count + kBinParts - 1 : count - 1;
        if (!finite(world->state(BodyId{static_cast<std::uint32_t>(last)})))
          throw Error(ExitCode::failed, "a state is not finite");
        rows.push_back(row);
      } catch (const std::exception& wrong) {
        fmt::print(stderr, "figure 12: {} ({}), {} {} bodies: {}\n", engine, preset, count, arrangement, wrong.what());
        break;
      }
      if (stop_signal() != 0) return rows;
      progress(rows.back());
    }
  }
  return rows;
}

std::vector<CostCurve> curves_of(const Rows& costs) {
  std::vector<CostCurve> curves;
  for (const Json& row : costs) {
    if (curves.empty() || !alike(curves.back().rows.back(), row, {"arrangement", "engine", "preset"}))
      curves.push_back({row.at("engine"), row.at("preset"), row.at("arrangement"), {}});
    curves.back().rows.push_back(row);
  }
  return curves;
}

LineFit per_body(const CostCurve& curve) { return fit(curve, "bodies"); }
LineFit per_contact(const CostCurve& curve) { return fit(curve, "contacts_mean"); }

std::string Fitting::text() const {
  return fmt::format("{}{:.0f}", below ? "fewer than " : above ? "at least " : "", bodies);
}

Fitting largest(const CostCurve& curve, double period_s, const std::string& quantile) {
  double bodies_before = 0.0, time_before_s = 0.0;
  for (const Json& row : curve.rows) {
    const double bodies = number(row, "bodies");
    const double time_s = number(row.at("step_s"), quantile);
    if (time_s > period_s) {
      if (bodies_before == 0.0) return {.bodies = bodies, .below = true};
      const double part = (period_s - time_before_s) / (time_s - time_before_s);
      return {.bodies = std::floor(bodies_before + part * (bodies - bodies_before))};
    }
    bodies_before = bodies;
    time_before_s = time_s;
  }
  return {.bodies = bodies_before, .above = true};
}

}  // namespace subworld
