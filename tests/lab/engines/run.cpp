#include "lab/engines/run.hpp"

#include "io/results/json.hpp"
#include "lab/page/engine_choice.hpp"
#include "lab/session/cpu_time.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>
#include <fmt/os.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>

namespace subworld {

namespace {

/// Stride for at most `most` evenly spaced entries.
int stride_of(int steps, int most) { return std::max(1, (steps + most - 1) / most); }

std::unique_ptr<Engine> engine_of(const EnginePoint& point) {
  const Scene& scene = point.scene->scene;
  EngineSettings settings;
  settings.name = point.engine;
  settings.preset = point.preset;
  settings.gravity = scene.settings.world.gravity;
  std::unique_ptr<Engine> engine = make_engine(settings, scene.meshes);
  for (Body body : scene.bodies) {
    // The pair's friction is the geometric mean, its restitution the product.
    body.material = {.friction = point.friction, .restitution = std::sqrt(point.restitution)};
    engine->add(body, scene.initial[index(body.id)]);
  }
  return engine;
}

/// The states of all movable bodies, a line for each.
class States {
 public:
  States(const std::string& path, const Scene& scene) : scene_(scene) {
    if (path.empty()) return;
    file_.emplace(fmt::output_file(path));
    file_->print("t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n");
  }
  void write(const Engine& engine, double t_s) {
    if (!file_) return;
    for (const Body& body : scene_.bodies) {
      if (body.fixed()) continue;
      const BodyState s = engine.state(body.id);
      const Vec3 &x = s.position, &v = s.linear_velocity, &w = s.angular_velocity;
      const Quat& q = s.orientation;
      file_->print(
          "{:.6g},{},{:.7g},{:.7g},{:.7g},{:.7g},{:.7g},{:.7g},{:.7g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n", t_s,
          index(body.id), x.x(), x.y(), x.z(), q.w(), q.x(), q.y(), q.z(), v.x(), v.y(), v.z(), w.x(), w.y(), w.z());
    }
  }

 private:
  const Scene& scene_;
  std::optional<fmt::ostream> file_;
};

/// Results of a run, step by step.
class Tally {
 public:
  void add(const Observed& seen, const StepTime& time, double dt_s) {
    wall_.add(time.wall_s);
    cpu_.add(time.cpu_s);
    last_ = seen;
    displacement_max_m_ = std::max(displacement_max_m_, seen.displacement_max_m);
    penetration_max_m_ = std::max(penetration_max_m_, seen.penetration_max_m);
    penetration_ratio_ = std::max(penetration_ratio_, seen.penetration_ratio);
    kinetic_max_j_ = std::max(kinetic_max_j_, seen.kinetic_j);
    contacts_.add(static_cast<double>(seen.contacts));
    late_kinetic_j_.push_back(seen.kinetic_j);
    if (static_cast<double>(late_kinetic_j_.size()) > std::max(1.0, kRestWindow_s / dt_s)) late_kinetic_j_.pop_front();
    const bool gone = seen.fallen || seen.penetration_ratio > kThroughRatio;
    if (gone && !fell_at_s_) fell_at_s_ = seen.t_s;
  }

  [[nodiscard]] Json json(const Judge& judge, const std::string& failure) const {
    double late_j = 0.0;
    for (const double j : late_kinetic_j_) late_j += j / static_cast<double>(late_kinetic_j_.size());
    const bool failed = !failure.empty();
    const double simulated_s = last_.t_s;
    const auto steps = static_cast<double>(wall_.count());
    return {{"step_s", quantiles(wall_)},
            {"held", !failed && !fell_at_s_},
            {"max_displacement_m", displacement_max_m_},
            {"kinetic_energy_j", late_j},
            {"penetration_max_m", penetration_max_m_},
            {"fell_at_s", fell_at_s_ ? Json(*fell_at_s_) : Json(nullptr)},
            {"failure", failure},
            {"at_rest", !failed && judge.at_rest(late_j)},
            {"top_displacement_m", last_.top_displacement_m},
            {"penetration_ratio", penetration_ratio_},
            {"kinetic_energy_max_j", kinetic_max_j_},
            {"potential_energy_j", last_.potential_j},
            {"contacts_mean", contacts_.mean()},
            {"contacts_max", contacts_.max},
            {"simulated_s", simulated_s},
            {"cpu_step_s", quantiles(cpu_)},
            {"cpu_s_per_simulated_s", simulated_s > 0.0 ? cpu_.mean_s() * steps / simulated_s : 0.0}};
  }

 private:
  Histogram wall_;
  Histogram cpu_;
  Observed last_;
  MeanMax contacts_;
  std::deque<double> late_kinetic_j_;  ///< of the last kRestWindow_s
  std::optional<double> fell_at_s_;
  double displacement_max_m_ = 0.0;
  double penetration_max_m_ = 0.0;
  double penetration_ratio_ = 0.0;
  double kinetic_max_j_ = 0.0;
};

Json history_row(const Observed& seen, const StepTime& time) {
  return {{"t_s", seen.t_s},
          {"kinetic_energy_j", seen.kinetic_j},
          {"potential_energy_j", seen.potential_j},
          {"step_s", time.wall_s},
          {"max_displacement_m", seen.displacement_max_m},
          {"penetration_max_m", seen.penetration_max_m},
          {"contacts", seen.contacts}};
}

Json settings_of(const EnginePoint& point) {
  return {{"scene", point.scene->scene.name}, {"engine", point.engine},           {"preset", point.preset},
          {"friction", point.friction},       {"restitution", point.restitution}, {"dt_s", point.dt_s},
          {"duration_s", point.duration_s}};
}

}  // namespace

LabScene load_lab_scene(const std::string& file) {
  LabScene loaded{load_scene(file), {}};
  keep_users(loaded.scene, 0);
  if (std::ranges::all_of(loaded.scene.bodies, [](const Body& b) { return b.fixed(); })) {
    throw Error(ExitCode::usage, fmt::format("{}: no body of this scene can move; choose another scene", file));
  }
  loaded.kind = kind_of(loaded.scene);
  return loaded;
}

int EnginePoint::steps() const { return std::max(1, static_cast<int>(std::lround(duration_s / dt_s))); }

std::string EnginePoint::file_name() const { return file_name_of(settings_of(*this)); }

std::string file_name_of(const Json& row) {
  std::string dt = step_text(number(row, "dt_s"));
  std::ranges::replace(dt, '/', '-');
  return fmt::format("{}_{}_{}_f{:g}_e{:g}_dt{}", row.at("scene").get<std::string>(),
                     row.at("engine").get<std::string>(), row.at("preset").get<std::string>(), number(row, "friction"),
                     number(row, "restitution"), dt);
}

StepTime timed_step(Engine& engine, double dt_s) {
  using Clock = std::chrono::steady_clock;
  const double cpu_begin_s = thread_cpu_s();
  const Clock::time_point begin = Clock::now();
  engine.step(dt_s);
  const std::chrono::duration<double> wall = Clock::now() - begin;
  return {wall.count(), thread_cpu_s() - cpu_begin_s};
}

std::optional<EngineRun> run_engine(const EnginePoint& point, const std::string& states_path,
                                    const std::function<void(double)>& progress) {
  const Judge judge(point.scene->scene, point.scene->kind);
  const int history_stride = stride_of(point.steps(), kMostHistoryRows);
  const int state_stride = stride_of(point.steps(), kMostStateFrames);
  EngineRun run;
  Tally tally;
  std::string failure;
  try {
    States states(states_path, point.scene->scene);
    const std::unique_ptr<Engine> engine = engine_of(point);
    for (int i = 1; i <= point.steps() && failure.empty(); ++i) {
      if (stop_signal() != 0) return std::nullopt;
      const StepTime time = timed_step(*engine, point.dt_s);
      const Observed seen = judge.look(*engine, i * point.dt_s);
      if (!seen.finite) failure = fmt::format("a state is not finite at {:.3g} s", seen.t_s);
      tally.add(seen, time, point.dt_s);
      if (i % history_stride == 0) run.history.push_back(history_row(seen, time));
      if (i % state_stride == 0) states.write(*engine, seen.t_s);
      progress(seen.t_s);
    }
  } catch (const std::exception& wrong) {
    failure = wrong.what();
  }
  run.row = settings_of(point);
  run.row.update(tally.json(judge, failure));
  run.row["kind"] = point.scene->kind == SceneKind::structure ? "structure" : "fall";
  run.row["bodies"] = std::ranges::count_if(point.scene->scene.bodies, [](const Body& body) { return !body.fixed(); });
  return run;
}

}  // namespace subworld
