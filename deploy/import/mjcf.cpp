#include "import/world.hpp"
#include "model/error.hpp"
#include "model/shapes/mass_properties.hpp"
#include "model/trigonometry.hpp"

#include <fmt/core.h>
#include <mujoco/mujoco.h>

#include <array>
#include <fstream>
#include <memory>
#include <set>

namespace subworld::import {

namespace {

namespace fs = std::filesystem;

Vec3 vector_of(const mjtNum* v) { return {v[0], v[1], v[2]}; }
Quat quat(const mjtNum* q) { return Quat(q[0], q[1], q[2], q[3]).normalized(); }
Quat towards(const Vec3& axis) { return turn_of_z(axis.normalized()); }

class MjcfReader {
 public:
  MjcfReader(const fs::path& file, fs::path folder) : folder_(std::move(folder)) {
    std::array<char, 1000> error{};
    model_.reset(mj_loadXML(file.c_str(), nullptr, error.data(), error.size()));
    if (!model_) throw Error(ExitCode::usage, fmt::format("{}: {}", file.string(), error.data()));
    data_.reset(mj_makeData(model_.get()));
    mj_kinematics(model_.get(), data_.get());
    mj_comPos(model_.get(), data_.get());
    world_.name = file.stem().string();
    world_.gravity = vector_of(model_->opt.gravity);
  }

  World read() {
    for (int body = 0; body < model_->nbody; ++body) read_body(body);
    for (int body = 1; body < model_->nbody; ++body) read_joints(body);
    for (int e = 0; e < model_->neq; ++e) read_equality(e);
    const auto omit = [this](int count, mjtObj type, std::string_view what) {
      for (int i = 0; i < count; ++i) world_.remark(0, fmt::format("{} {} is omitted", what, name(type, i, what)));
    };
    omit(model_->nu, mjOBJ_ACTUATOR, "actuator");
    omit(model_->ntendon, mjOBJ_TENDON, "tendon");
    omit(model_->nsensor, mjOBJ_SENSOR, "sensor");
    if (model_->nskin > 0) world_.remark(0, fmt::format("{} skins are omitted", model_->nskin));
    if (visual_ > 0) world_.remark(0, fmt::format("{} geoms without collisions are omitted", visual_));
    return std::move(world_);
  }

 private:
  [[nodiscard]] std::string name(mjtObj type, int id, std::string_view what) const {
    const char* const text = mj_id2name(model_.get(), type, id);
    return text != nullptr && text[0] != 0 ? std::string(text) : fmt::format("{}{}", what, id);
  }
  [[nodiscard]] std::string body_name(int body) const { return body == 0 ? "world" : name(mjOBJ_BODY, body, "body"); }
  [[nodiscard]] Pose pose_of(int body) const {
    return {vector_of(data_->xpos + 3 * body), quat(data_->xquat + 4 * body)};
  }
  /// Rigidly connected to the world.
  [[nodiscard]] bool fixed(int body) const { return model_->body_weldid[body] == 0; }

  void read_body(int body) {
    Link link;
    link.name = body_name(body);
    link.pose = pose_of(body);
    link.fixed = fixed(body);
    link.mass = model_->body_mass[body];
    link.centre = vector_of(model_->body_ipos + 3 * body);
    const Eigen::Matrix3d turn = quat(model_->body_iquat + 4 * body).toRotationMatrix();
    link.inertia = turn * vector_of(model_->body_inertia + 3 * body).asDiagonal() * turn.transpose();
    for (int i = 0; i < model_->body_geomnum[body]; ++i) read_geom(model_->body_geomadr[body] + i, link);
    if (body == 0 && link.shapes.empty()) return;
    world_.links.push_back(std::move(link));
  }

  void read_geom(int g, Link& link) {
    Geometry shape;
    shape.name = name(mjOBJ_GEOM, g, "geom");
    if (model_->geom_contype[g] == 0 && model_->geom_conaffinity[g] == 0) {
      ++visual_;
      return;
    }
    shape.pose = {vector_of(model_->geom_pos + 3 * g), quat(model_->geom_quat + 4 * g)};
    const mjtNum* const friction = model_->geom_friction + 3 * g;
    shape.surface = {.friction = friction[0],
                     .spinning_friction = friction[1],
                     .rolling_friction = friction[2],
                     .directions = model_->geom_condim[g]};
    const mjtNum* const size = model_->geom_size + 3 * g;
    shape.radius = size[0];
    shape.length = 2.0 * size[1];
    switch (model_->geom_type[g]) {
      case mjGEOM_PLANE:
        shape.kind = Geometry::Kind::plane;
        break;
      case mjGEOM_SPHERE:
        shape.kind = Geometry::Kind::sphere;
        break;
      case mjGEOM_CAPSULE:
        shape.kind = Geometry::Kind::capsule;
        break;
      case mjGEOM_CYLINDER:
        shape.kind = Geometry::Kind::cylinder;
        break;
      case mjGEOM_BOX:
        shape.kind = Geometry::Kind::box;
        shape.size = 2.0 * vector_of(size);
        break;
      case mjGEOM_MESH:
        shape.kind = Geometry::Kind::mesh;
        shape.file = write_mesh(model_->geom_dataid[g]);
        shape.is_hull = true;
        break;
      default:
        return world_.remark(0, fmt::format("geom {} of {}: its type is omitted", shape.name, link.name));
    }
    link.shapes.push_back(std::move(shape));
  }

  /// MuJoCo collides with the convex hull of a mesh.
  fs::path write_mesh(int id) {
    const fs::path file = folder_ / (name(mjOBJ_MESH, id, "mesh") + ".obj");
    if (!written_.insert(id).second) return file;
    fs::create_directories(folder_);
    std::ofstream out(file);
    const float* const vertices = model_->mesh_vert + 3 * model_->mesh_vertadr[id];
    for (int i = 0; i < model_->mesh_vertnum[id]; ++i)
      out << fmt::format("v {:.9g} {:.9g} {:.9g}\n", vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]);
    const int* const faces = model_->mesh_face + 3 * model_->mesh_faceadr[id];
    for (int i = 0; i < model_->mesh_facenum[id]; ++i)
      out << fmt::format("f {} {} {}\n", faces[3 * i] + 1, faces[3 * i + 1] + 1, faces[3 * i + 2] + 1);
    return file;
  }

  [[nodiscard]] JointAxis axis_of(int j) const {
    JointAxis axis{.free = true};
    const int dof = model_->jnt_dofadr[j];
    const double start = model_->qpos0[model_->jnt_qposadr[j]];  // the joint's zero of the scene
    if (model_->jnt_limited[j] != 0) {
      axis.lower = model_->jnt_range[2 * j] - start;
      axis.upper = model_->jnt_range[2 * j + 1] - start;
    }
    axis.friction = model_->dof_frictionloss[dof];
    axis.damping = model_->dof_damping[dof];
    axis.stiffness = model_->jnt_stiffness[j];
    if (axis.stiffness > 0.0) axis.rest = model_->qpos_spring[model_->jnt_qposadr[j]] - start;
    return axis;
  }

  void read_joints(int body) {
    const int first = model_->body_jntadr[body], count = model_->body_jntnum[body];
    LinkJoint joint;
    joint.a = body_name(body);
    const int parent = model_->body_parentid[body];
    joint.b = fixed(parent) ? std::string() : body_name(parent);
    joint.frame = pose_of(body);
    if (count == 0) {
      joint.name = joint.a + ".weld";
      if (!fixed(body)) world_.joints.push_back(std::move(joint));
      return;
    }
    joint.name = name(mjOBJ_JOINT, first, "joint");
    if (model_->jnt_type[first] == mjJNT_FREE) return;
    for (int j = first; j < first + count; ++j) {
      if (model_->dof_armature[model_->jnt_dofadr[j]] > 0.0)
        world_.remark(0, fmt::format("joint {}: armature is omitted", name(mjOBJ_JOINT, j, "joint")));
    }
    joint.frame.position = vector_of(data_->xanchor + 3 * first);
    const auto type = [&](int i) { return model_->jnt_type[first + i]; };
    const auto axis = [&](int i) { return vector_of(data_->xaxis + 3 * (first + i)); };
    if (count == 1 && type(0) == mjJNT_BALL) {
      joint.kind = JointKind::ball;
      JointAxis all = axis_of(first);
      if (std::isfinite(all.upper)) world_.remark(0, fmt::format("joint {}: its limit is omitted", joint.name));
      all.lower = -INFINITY, all.upper = INFINITY, all.rest = 0.0;
      for (std::size_t i = 3; i < 6; ++i) joint.axes[i] = all;
    } else if (count == 1) {
      joint.kind = type(0) == mjJNT_HINGE ? JointKind::hinge : JointKind::slider;
      joint.frame.orientation = towards(axis(0));
      joint.axes[type(0) == mjJNT_HINGE ? 5 : 2] = axis_of(first);
    } else if (!read_several(first, count, joint)) {
      world_.remark(
          0, fmt::format("joints of body {}: no joint of a scene is like all of them together; they are omitted, "
                         "and the body is free",
                         joint.a));
      return;
    }
    world_.joints.push_back(std::move(joint));
  }

  /// Perpendicular axes at one place: a joint of six directions.
  bool read_several(int first, int count, LinkJoint& joint) const {
    Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
    std::vector<Vec3> known;
    for (int j = first; j < first + count; ++j) {
      if (model_->jnt_type[j] == mjJNT_BALL) return false;
      const Vec3 axis = vector_of(data_->xaxis + 3 * j);
      const bool old = std::any_of(known.begin(), known.end(), [&](const Vec3& k) { return k.dot(axis) > 1 - 1e-6; });
      if (old) continue;
      for (const Vec3& k : known) {
        if (std::abs(k.dot(axis)) > 1e-3) return false;
      }
      known.push_back(axis);
    }
    int turns = 0, slides = 0;
    for (int j = first; j < first + count; ++j) (model_->jnt_type[j] == mjJNT_HINGE ? turns : slides) += 1;
    if (known.size() < 2) known.push_back(known[0].unitOrthogonal());
    axes.col(0) = known[0];
    axes.col(2) = known[0].cross(known[1]).normalized();
    axes.col(1) = axes.col(2).cross(known[0]);
    Eigen::Index last_turn = -1;
    for (int j = first; j < first + count; ++j) {
      const bool hinge = model_->jnt_type[j] == mjJNT_HINGE;
      if (hinge && (vector_of(data_->xanchor + 3 * j) - joint.frame.position).norm() > 1e-6 && turns > 1) return false;
      const Vec3 along = axes.transpose() * vector_of(data_->xaxis + 3 * j);
      Eigen::Index which = 0;
      along.cwiseAbs().maxCoeff(&which);
      JointAxis axis = axis_of(j);
      if (along[which] < 0.0) {
        std::swap(axis.lower, axis.upper);
        axis.lower *= -1.0, axis.upper *= -1.0, axis.rest *= -1.0;
      }
      if (hinge && turns > 1 && which <= last_turn) return false;
      if (hinge) last_turn = which;
      joint.axes[static_cast<std::size_t>(which + (hinge ? 3 : 0))] = axis;
    }
    joint.frame.orientation = Quat(axes);
    joint.kind = JointKind::six;
    return true;
  }

  void read_equality(int e) {
    const std::string what = name(mjOBJ_EQUALITY, e, "equality");
    const int type = model_->eq_type[e], a = model_->eq_obj1id[e], b = model_->eq_obj2id[e];
    if (model_->eq_active[e] == 0 || (type != mjEQ_CONNECT && type != mjEQ_WELD))
      return world_.remark(0, fmt::format("equality {} is omitted", what));
    LinkJoint joint;
    joint.name = what;
    joint.a = body_name(a);
    joint.b = fixed(b) ? std::string() : body_name(b);
    joint.frame = pose_of(a);
    if (type == mjEQ_CONNECT) {
      joint.kind = JointKind::ball;
      joint.frame.position = (joint.frame * Pose{vector_of(model_->eq_data + mjNEQDATA * e), {}}).position;
      for (std::size_t i = 3; i < 6; ++i) joint.axes[i].free = true;
    }
    world_.joints.push_back(std::move(joint));
  }

  std::unique_ptr<mjModel, void (*)(mjModel*)> model_{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, void (*)(mjData*)> data_{nullptr, mj_deleteData};
  fs::path folder_;
  World world_;
  std::set<int> written_;
  int visual_ = 0;
};

}  // namespace

World read_mjcf(const std::filesystem::path& file, const std::filesystem::path& folder) {
  return MjcfReader(file, folder).read();
}

}  // namespace subworld::import
