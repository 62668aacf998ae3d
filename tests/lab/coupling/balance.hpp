#pragma once

#include "lab/session/coupled_run.hpp"

#include <vector>

namespace subworld {

/// Momentum that the users gave, against what the world received.
///
/// | symbol | unit | is |
/// |---|---|---|
/// | J | N s | impulse of the device on the proxy in the sub-world, since t = 0 |
/// | P | N s | impulse that has been passed on to the world, until the same stamp (coupling/tool/impulse_account) |
/// | F | N | felt force |
///
///   error = |sum J - sum P| / sum of integral |F| dt,  over one user or all                                  (1)
struct MomentumBalance {
  Vec3 missing_n_s = Vec3::Zero();  ///< J - P
  double impulse_n_s = 0.0;         ///< integral |F| dt

  void add(const MomentumBalance& other) noexcept {
    missing_n_s += other.missing_n_s;
    impulse_n_s += other.impulse_n_s;
  }
  /// Not a number without a force.
  [[nodiscard]] double error_ratio() const noexcept { return missing_n_s.norm() / impulse_n_s; }
};

/// Distances between the copies of a body that two users' sub-worlds hold, at the same stamp and before any correction.
class CopyDifference {
 public:
  void add(double distance_m) noexcept;
  void add(const CopyDifference& other) noexcept;
  /// Over all cycles, shared bodies and pairs of copies; not a number where no body is shared.
  [[nodiscard]] double rms_m() const noexcept;
  [[nodiscard]] double max_m() const noexcept;

 private:
  double squares_m2_ = 0.0, max_m_ = 0.0;
  std::uint64_t count_ = 0;
};

struct UserBalance {
  MomentumBalance momentum;
  double created_j =
      0.0;  ///< delivered to the operator beyond what the coupling could store (coupling/safety/energy_port)
  double bounded_ratio = 0.0;  ///< share of the steps in which the passivity bound acted
  double oscillation_n = 0.0;  ///< of the force on the operator (coupling/safety/oscillation)
  CopyDifference copies;       ///< of this user's copies from those of each other user
};

/// Keeps account of a run, in which its world and its sub-worlds are compared after each cycle of the world.
class BalanceWatch {
 public:
  BalanceWatch(const CoupledRun& run, const Scene& scene);
  /// Call after each cycle of the world.
  void observe();
  [[nodiscard]] std::vector<UserBalance> by_user(double h_s) const;

 private:
  struct Copy {
    std::size_t user;
    Vec3 position;
  };
  const CoupledRun& run_;
  SchemeProperties scheme_;
  std::vector<CopyDifference> copies_;      ///< by user
  std::vector<MomentumBalance> momentum_;   ///< by user, at the last stamp of which there is a report
  std::vector<std::vector<Copy>> holders_;  ///< by body
  std::vector<BodyId> held_;
};

}  // namespace subworld
