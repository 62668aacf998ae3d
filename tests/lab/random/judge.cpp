#include "lab/random/judge.hpp"

#include "coupling/plan.hpp"
#include "coupling/safety/force_guard.hpp"
#include "io/results/json.hpp"
#include "lab/random/energy_book.hpp"
#include "lab/random/scene.hpp"
#include "lab/session/coupled_run.hpp"

#include <fmt/core.h>

#include <cmath>
#include <ctime>

namespace subworld {

namespace {

void fail(Verdict& verdict, Fault fault, double at_s, std::string reason) {
  if (verdict.fault != Fault::none) return;
  verdict.fault = fault;
  verdict.at_s = at_s;
  verdict.reason = std::move(reason);
}

/// One run of a scene, with the energy balance of its world.
class Trial {
 public:
  Trial(const Scene& scene, const EngineMaker& make)
      : scene_(scene), run_(scene, [&](const EngineSettings& settings, std::span<const Mesh> meshes) {
          auto booked = std::make_unique<BookedEngine>(make(settings, meshes), settings.gravity);
          engine_ = booked.get();
          return booked;
        }) {
    engine_->begin();
    double weight_n = 0.0;
    for (const Body& body : scene.bodies)
      weight_n += body.gravity ? body.mass * scene.settings.world.gravity.norm() : 0.0;
    double depth_m = scene.settings.settle_s > 0.0 ? 0.0 : deepest_overlap(scene).depth_m;
    for (const Contact& c : engine_->contacts()) depth_m = std::max(depth_m, -c.distance);
    tolerance_j_ = kLeastGain_j + (kRestDepth_m + depth_m) * weight_n;
  }

  void go(Verdict& verdict) {
    while (!run_.world.facts().over) {
      run_.cycle();
      if (!run_.finite()) {
        fail(verdict, Fault::not_finite, run_.world.facts().time_s,
             fmt::format("a state is not finite at {:.4g} s", run_.world.facts().time_s));
        return;
      }
      weigh(verdict);
    }
    for (std::size_t u = 0; u < run_.felt.size(); ++u) check_operator(u, verdict);
    judge_energy(verdict);
    for (std::size_t u = 0; u < run_.felt.size(); ++u) check_port(u, verdict);
  }

  [[nodiscard]] std::uint64_t hash() const { return run_.hash(); }

 private:
  void weigh(Verdict& verdict) {
    const EnergyBook& book = engine_->book();
    const double tolerance_j = tolerance_j_ + book.reading_j;
    const double above_j = book.unexplained_j() - tolerance_j;
    const double put_in_j = book.put_in_j();
    const double gain = above_j <= 0.0 ? 0.0 : above_j / std::max(put_in_j, tolerance_j);
    if (above_s_ < 0.0 && gain > kMostGain) above_s_ = run_.world.facts().time_s;
    if (gain < verdict.gain) return;
    verdict.gain = gain;
    verdict.unexplained_j = book.unexplained_j();
    verdict.put_in_j = put_in_j;
    verdict.users_j = book.work_j;
    verdict.corrected_j = book.corrected_j;
    verdict.released_j = book.released_j;
  }

  void judge_energy(Verdict& verdict) const {
    if (above_s_ < 0.0) return;
    fail(verdict, Fault::energy, above_s_,
         fmt::format("{:.3g} J unexplained, {:.3g} % of the {:.3g} J that users, corrections, gravity and the initial "
                     "motion put in; first above the bound at {:.4g} s",
                     verdict.unexplained_j, 1e2 * verdict.gain, verdict.put_in_j, above_s_));
  }

  void check_operator(std::size_t user, Verdict& verdict) const {
    constexpr double kRounding = 1e-9;
    const OperatorLimits limits = operator_limits_of(scene_.users[user].device);
    const double h = scene_.settings.h_s;
    const double most_step_n = limits.force_rate_n_s * h + kRounding * limits.wrench.force_n;
    Vec3 before = Vec3::Zero();
    const std::vector<Vec3>& forces = run_.felt[user].on_operator;
    for (std::size_t i = 0; i < forces.size(); ++i) {
      const double t_s = h * static_cast<double>(i), size_n = forces[i].norm(), step_n = (forces[i] - before).norm();
      if (!forces[i].allFinite()) {
        fail(verdict, Fault::force, t_s, fmt::format("the force on operator {} is not finite at {:.4g} s", user, t_s));
      } else if (size_n > limits.wrench.force_n * (1.0 + kRounding)) {
        fail(verdict, Fault::force, t_s,
             fmt::format("{:.4g} N on operator {} at {:.4g} s, the limit is {:g} N", size_n, user, t_s,
                         limits.wrench.force_n));
      } else if (step_n > most_step_n) {
        fail(verdict, Fault::force, t_s,
             fmt::format("the force on operator {} changes by {:.4g} N in a step at {:.4g} s, the limit is {:g} N",
                         user, step_n, t_s, most_step_n));
      }
      verdict.force_n = std::max(verdict.force_n, size_n);
      before = forces[i];
    }
  }

  void check_port(std::size_t user, Verdict& verdict) const {
    const OperatorPort& port = run_.guards[user]->port();
    // Energy of bodies that fall or fly into an operator's proxy is not created.
    const double created_j = port.created_j() - run_.world.facts().released_j;
    verdict.at_operator_j = std::max(verdict.at_operator_j, created_j);
    const double most_j = kMostAtOperator_j + kMostAtOperator * std::abs(port.net_j());
    if (enabled(scene_, Optimisation::energy_bound, user) || created_j <= most_j) return;
    fail(verdict, Fault::port, scene_.settings.duration_s,
         fmt::format("operator {} received {:.3g} J beyond what the coupling could store, with passivity on; the limit "
                     "is {:.3g} J",
                     user, created_j, most_j));
  }

  const Scene& scene_;
  BookedEngine* engine_ = nullptr;
  CoupledRun run_;
  double tolerance_j_ = 0.0;
  double above_s_ = -1.0;  ///< time at which the energy first exceeded its bound
};

double cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

}  // namespace

Json to_json(const Verdict& v) {
  return {{"fault", static_cast<int>(v.fault)},
          {"reason", v.reason},
          {"at_s", v.at_s},
          {"gain", v.gain},
          {"unexplained_j", v.unexplained_j},
          {"put_in_j", v.put_in_j},
          {"users_j", v.users_j},
          {"corrected_j", v.corrected_j},
          {"released_j", v.released_j},
          {"at_operator_j", v.at_operator_j},
          {"force_n", v.force_n},
          {"seconds", v.seconds},
          {"hash", v.hash}};
}

Verdict verdict_of(const Json& json) {
  Verdict v;
  v.fault = static_cast<Fault>(json.at("fault").get<int>());
  v.reason = json.at("reason");
  v.hash = json.at("hash");
  const auto number = [&](const char* key) { return json.at(key).is_number() ? json.at(key).get<double>() : NAN; };
  v.at_s = number("at_s");
  v.gain = number("gain");
  v.unexplained_j = number("unexplained_j");
  v.put_in_j = number("put_in_j");
  v.users_j = number("users_j");
  v.corrected_j = number("corrected_j");
  v.released_j = number("released_j");
  v.at_operator_j = number("at_operator_j");
  v.force_n = number("force_n");
  v.seconds = number("seconds");
  return v;
}

Verdict judged(const Scene& scene, const EngineMaker& make) {
  Verdict verdict;
  const double began_s = cpu_s();
  try {
    Trial first(scene, make);
    first.go(verdict);
    verdict.hash = fmt::format("{:016x}", first.hash());
    Verdict again;
    Trial second(scene, make);
    second.go(again);
    if (const std::string hash = fmt::format("{:016x}", second.hash());
        hash != verdict.hash && verdict.fault != Fault::not_finite) {
      verdict.fault = Fault::hash;
      verdict.at_s = scene.settings.duration_s;
      verdict.reason = fmt::format("the second run has the hash {}, the first {}", hash, verdict.hash);
    }
  } catch (const std::exception& wrong) {
    verdict.fault = Fault::none;
    fail(verdict, Fault::exception, 0.0, fmt::format("exception: {}", wrong.what()));
  }
  verdict.seconds = cpu_s() - began_s;
  return verdict;
}

}  // namespace subworld
