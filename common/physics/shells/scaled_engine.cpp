#include "physics/shells/scaled_engine.hpp"

namespace subworld {

namespace {

Shape scaled(Shape shape, double unit_m) {
  shape.half_extents /= unit_m;
  shape.radius /= unit_m;
  shape.half_length /= unit_m;
  return shape;
}

}  // namespace

EngineSettings scaled(EngineSettings settings, double unit_m) {
  settings.gravity /= unit_m;
  return settings;
}

std::vector<Mesh> scaled(std::span<const Mesh> meshes, double unit_m) {
  std::vector<Mesh> result(meshes.begin(), meshes.end());
  for (Mesh& mesh : result) {
    for (Vec3& vertex : mesh.vertices) vertex /= unit_m;
    for (BodyPart& part : mesh.parts) {
      part.shape = scaled(part.shape, unit_m);
      part.pose.position /= unit_m;
    }
  }
  return result;
}

void ScaledEngine::set_joints(std::span<const Joint> joints) {
  std::vector<Joint> large(joints.begin(), joints.end());
  const double length = unit_m_, angle = unit_m_ * unit_m_;
  for (Joint& joint : large) {
    joint.in_a.position /= length;
    joint.in_b.position /= length;
    for (std::size_t i = 0; i < joint.axes.size(); ++i) {
      JointAxis& axis = joint.axes[i];
      if (i < 3) {
        for (double* value : {&axis.lower, &axis.upper, &axis.rest, &axis.speed, &axis.friction, &axis.most})
          *value /= length;
      } else {
        for (double* value : {&axis.stiffness, &axis.damping, &axis.friction, &axis.most}) *value /= angle;
      }
    }
  }
  inner_->set_joints(large);
}

BodyState ScaledEngine::shown(const BodyState& state) const {
  return {state.position / unit_m_, state.orientation, state.linear_velocity / unit_m_, state.angular_velocity};
}

void ScaledEngine::add(const Body& body, const BodyState& state, Role role) {
  Body large = body;
  large.shape = scaled(body.shape, unit_m_);
  large.surface_velocity /= unit_m_;
  large.material.rolling_friction /= unit_m_;
  large.material.spinning_friction /= unit_m_;
  large.inertia /= unit_m_ * unit_m_;
  inner_->add(large, shown(state), role);
  contacts_.clear();
}

void ScaledEngine::remove(BodyId id) {
  inner_->remove(id);
  contacts_.clear();
}

void ScaledEngine::remove_all(std::span<const BodyId> ids) {
  inner_->remove_all(ids);
  contacts_.clear();
}

BodyState ScaledEngine::state(BodyId id) const {
  const BodyState large = inner_->state(id);
  return {large.position * unit_m_, large.orientation, large.linear_velocity * unit_m_, large.angular_velocity};
}

bool ScaledEngine::set_state(BodyId id, const BodyState& state) { return inner_->set_state(id, shown(state)); }

bool ScaledEngine::set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) {
  return inner_->set_velocity(id, linear / unit_m_, angular);
}

void ScaledEngine::set_inertia(BodyId id, double mass, const Vec3& inertia) {
  inner_->set_inertia(id, mass, inertia / (unit_m_ * unit_m_));
}

bool ScaledEngine::apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) {
  return inner_->apply_impulse(id, impulse / unit_m_, point / unit_m_);
}

bool ScaledEngine::apply_force(BodyId id, const Vec3& force, const Vec3& torque) {
  return inner_->apply_force(id, force / unit_m_, torque / (unit_m_ * unit_m_));
}

void ScaledEngine::stepped(double) {
  take(inner_->contacts());
  const std::span<const JointLoad> loads = inner_->joint_loads();
  loads_.assign(loads.begin(), loads.end());
  for (JointLoad& load : loads_) {
    load.impulse *= unit_m_;
    load.turn *= unit_m_ * unit_m_;
    load.motor_j *= unit_m_ * unit_m_;
  }
}

std::span<const Contact> ScaledEngine::contacts_with_friction() {
  take(inner_->contacts_with_friction());
  return contacts_;
}

void ScaledEngine::take(std::span<const Contact> large) {
  contacts_.assign(large.begin(), large.end());
  for (Contact& contact : contacts_) {
    contact.point *= unit_m_;
    contact.distance *= unit_m_;
    contact.normal_impulse *= unit_m_;
    contact.tangential_impulse *= unit_m_;
  }
}

Box ScaledEngine::bounds(BodyId id) const {
  const Box large = inner_->bounds(id);
  return {large.lower * unit_m_, large.upper * unit_m_};
}

void ScaledEngine::overlap(const Box& box, std::vector<BodyId>& out) const {
  inner_->overlap({box.lower / unit_m_, box.upper / unit_m_}, out);
}

void ScaledEngine::restore(const Checkpoint& checkpoint) {
  inner_->restore(checkpoint);
  contacts_.clear();
}

}  // namespace subworld
