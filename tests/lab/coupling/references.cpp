#include "lab/coupling/causal.hpp"
#include "lab/coupling/measure.hpp"

#include <fmt/core.h>

#include <utility>

namespace subworld {

namespace {

constexpr int kFiner = 4;  ///< refinement of the step for the error of the reference

/// Every `step`th force of each user.
std::vector<FeltHistory> thinned(const std::vector<FeltHistory>& felt, std::size_t step) {
  std::vector<FeltHistory> kept(felt.size());
  for (std::size_t u = 0; u < felt.size(); ++u) {
    for (std::size_t i = 0; i < felt[u].force.size(); i += step) {
      kept[u].force.push_back(felt[u].force[i]);
      kept[u].on_operator.push_back(felt[u].on_operator[i]);
    }
  }
  return kept;
}

}  // namespace

std::optional<Reference> reference_of(const Scene& scene) {
  std::optional<Outcome> run = run_out(scene);
  if (!run) return std::nullopt;
  const std::optional<Outcome> fine = run_out(refined(scene, kFiner));
  if (!fine) return std::nullopt;
  const double h_s = scene.settings.h_s;
  const std::vector<FeltHistory> finer = thinned(fine->felt, kFiner);
  Reference reference{.run = {},
                      .error = force_error(run->felt, finer, h_s).rms,
                      .errors = force_errors(run->felt, finer, h_s),
                      .on_operator_errors = force_errors(run->felt, finer, h_s, &FeltHistory::on_operator),
                      .drift_m = drift_max_m(scene, run->end, fine->end)};
  reference.run = std::move(*run);
  return reference;
}

const Reference* References::of(const Point& point) {
  const std::string key = reference_key(point);
  if (const auto found = known_.find(key); found != known_.end()) return &found->second;
  std::optional<Reference> reference = reference_of(reference_scene_of(point));
  return reference ? &known_.emplace(key, std::move(*reference)).first->second : nullptr;
}

const Outcome* References::run_of(const Point& point) {
  const std::string key = reference_key(point);
  if (const auto found = known_.find(key); found != known_.end()) return &found->second.run;
  if (const auto found = runs_.find(key); found != runs_.end()) return &found->second;
  std::optional<Outcome> run = run_out(reference_scene_of(point));
  return run ? &runs_.emplace(key, std::move(*run)).first->second : nullptr;
}

const CausalErrors* References::causal_of(const Point& point) {
  const DelaySettings delay = scene_of(point).settings.delay;
  const std::string key = fmt::format("{}|{}|{}|{}|{}|{}", reference_key(point), delay.down_s, delay.from_device_s,
                                      delay.jitter_s, delay.loss_ratio, delay.seed);
  if (const auto found = causal_.find(key); found != causal_.end()) return &found->second;
  const Outcome* const reference = run_of(point);
  if (reference == nullptr) return nullptr;
  std::optional<CausalErrors> errors = causal_errors_of(reference_scene_of(point), delay, *reference);
  return errors ? &causal_.emplace(key, std::move(*errors)).first->second : nullptr;
}

}  // namespace subworld
