#pragma once

#include "physics/bullet/movers.hpp"

#include <cstdint>
#include <vector>

namespace subworld::bullet {

/// Rolling and spinning friction: torques against the turning of one body on the other. Rolling is about axes across
/// the normal, spinning about the normal. Each torque is at most a length times the normal force.
class TurningFriction {
 public:
  void clear() { pairs_.clear(); }
  /// Gives the pair its entry, if its surfaces have such friction. `before`: velocities before the step, where a solver
  /// computes changes.
  void add(ContactPair& pair, const BothInertia& inertia, const BothMotion& before);
  /// A small step begins.
  void start();
  /// One iteration, with the sum of the pair's normal impulses. Returns whether it changed anything.
  bool solve(const ContactPair& pair, btScalar normal_impulse, BothMotion& motion);

 private:
  struct Entry {
    Row rows[3];  ///< without a linear part; the last one about the normal
    btScalar rolling, spinning;
  };
  std::vector<Entry> pairs_;
};

}  // namespace subworld::bullet
