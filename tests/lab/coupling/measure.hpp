#pragma once

#include "io/results/json.hpp"
#include "lab/coupling/balance.hpp"
#include "lab/coupling/sweep.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// Results of a run.
struct Outcome {
  bool finite = true;
  std::vector<FeltHistory> felt;     ///< by user
  std::vector<UserBalance> balance;  ///< by user
  MomentumBalance momentum;          ///< of all users
  std::vector<BodyState> end;        ///< of the scene's bodies, in the world
  double energy_excess_j = 0.0;
  double device_work_j = 0.0;      ///< of all users
  double device_sent_ratio = 1.0;  ///< mean over the users
  int substeps = 1;
  CpuTimes cpu;
  double simulated_s = 0.0;
  MeanMax ratio;            ///< by cycle
  std::vector<int> ratios;  ///< by haptic step of the world's time
  MeanMax members;          ///< per user and cycle, like the next two
  MeanMax ghosts;
  MeanMax border_pairs;
};

using Prepare = std::function<void(CoupledRun&)>;
/// `prepare` is called before the first cycle. Empty if a signal requested a stop.
[[nodiscard]] std::optional<Outcome> run_out(const Scene& scene, const Prepare& prepare = {});

/// What a point changes in a run beside its scene.
[[nodiscard]] Prepare prepare_of(const Point& point);

struct Reference {
  Outcome run;
  double error = 0.0;              ///< RMS force error of the reference against itself at h / 4, of all users
  std::vector<ForceError> errors;  ///< the same, by user
  std::vector<ForceError> on_operator_errors;  ///< of the force on the operator
  double drift_m = 0.0;                        ///< between both at the end: the largest distance of a body
};

/// Reference of a scene in one world (lab/sweep). Empty if a signal requested a stop.
[[nodiscard]] std::optional<Reference> reference_of(const Scene& scene);

/// The largest distance between the places of a movable body in two states of a scene, m.
[[nodiscard]] double drift_max_m(const Scene& scene, const std::vector<BodyState>& a, const std::vector<BodyState>& b);

/// Which force of a history is compared.
using ForceOf = std::vector<Vec3> FeltHistory::*;

/// Difference of the forces of all users in two runs of one scene.
[[nodiscard]] ForceError force_error(const std::vector<FeltHistory>& felt, const std::vector<FeltHistory>& reference,
                                     double h_s, ForceOf force = &FeltHistory::force);

/// The same for each user.
[[nodiscard]] std::vector<ForceError> force_errors(const std::vector<FeltHistory>& felt,
                                                   const std::vector<FeltHistory>& reference, double h_s,
                                                   ForceOf force = &FeltHistory::force);

/// RMS force errors of an ideal coupling (lab/coupling/causal).
struct CausalErrors {
  double all = 0.0;  ///< of all users
  std::vector<double> by_user;
};

/// Cache of references.
class References {
 public:
  /// Empty if a signal requested a stop.
  [[nodiscard]] const Reference* of(const Point& point);
  /// Without the error of the reference, which takes most of the time.
  [[nodiscard]] const Outcome* run_of(const Point& point);
  /// With the delay of the point.
  [[nodiscard]] const CausalErrors* causal_of(const Point& point);

 private:
  std::map<std::string, Reference> known_;
  std::map<std::string, Outcome> runs_;
  std::map<std::string, CausalErrors> causal_;
};

/// Felt force of a user, with the reference.
struct Trace {
  std::string scene;
  std::size_t user = 0;
  std::string scheme;
  int ratio = 1;
  double latency_s = 0.0;
  std::string name;  ///< of the file, without its extension
  double h_s = 0.0;
  std::vector<Vec3> force;  ///< N
  std::vector<Vec3> reference;
  std::vector<int> ratios;  ///< by haptic step
};

struct Measured {
  Json row;                   ///< flat
  std::vector<Json> users;    ///< a flat row for each user
  std::vector<Trace> traces;  ///< by user
};

class MutualLatencies;

/// Empty if a signal requested a stop. With `mutual`, users also have their mutual latency (lab/coupling/mutual), which
/// takes a run more for each user.
[[nodiscard]] std::optional<Measured> measure(const Point& point, References& references,
                                              MutualLatencies* mutual = nullptr);

/// CPU seconds per simulated second, summed over a row.
[[nodiscard]] double total_cpu(const Json& row);

}  // namespace subworld
