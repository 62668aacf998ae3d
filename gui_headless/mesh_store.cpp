#include "mesh_store.hpp"

#include "shape_mesh.hpp"

#include <array>
#include <cstddef>
#include <functional>
#include <string_view>

namespace subworld {
namespace {

// The more bodies, the fewer triangles has a round one, because it is smaller in the picture.
struct Fineness {
  std::size_t fewer_than;  // bodies
  int segments;
};
constexpr std::array<Fineness, 3> kFineness{{{600, 48}, {3000, 16}, {static_cast<std::size_t>(-1), 12}}};

std::uint64_t content_hash(const Mesh& mesh) {
  const auto bytes = [](const auto& values) {
    return std::string_view(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  const std::hash<std::string_view> hash;
  return hash(bytes(mesh.vertices)) * 31 + hash(bytes(mesh.triangles));
}

void read_instances_from(std::size_t first) {
  GLuint location = 4;
  const auto attribute = [&](GLint size, std::size_t offset) {
    describe_attribute(location++, size, sizeof(Instance), first * sizeof(Instance) + offset, 1);
  };
  attribute(3, offsetof(Instance, position));
  attribute(4, offsetof(Instance, orientation));
  attribute(3, offsetof(Instance, scale));
  attribute(1, offsetof(Instance, half_length));
  attribute(3, offsetof(Instance, colour));
}

}  // namespace

MeshStore::MeshStore() {
  for (std::size_t k = 0; k < kFineness.size(); ++k) {
    const int segments = kFineness[k].segments;
    units_[k] = {upload(sphere_mesh(segments)), upload(box_mesh()), upload(capsule_mesh(segments)),
                 upload(cylinder_mesh(segments)), upload(cone_mesh(segments))};
  }
  glGenBuffers(1, &buffer_);
}

void MeshStore::begin(std::span<const Mesh> meshes, std::size_t bodies) {
  std::erase_if(files_, [](const auto& entry) {
    if (!entry.second.used) release(entry.second.mesh);
    return !entry.second.used;
  });
  for (auto& entry : files_) entry.second.used = false;
  meshes_ = meshes;
  fineness_ = 0;
  while (bodies >= kFineness[fineness_].fewer_than) ++fineness_;
  instances_.clear();
}

GlMesh MeshStore::find(Model model) {
  if (model < Model::file) return units_[fineness_][static_cast<std::size_t>(model)];
  const Mesh& mesh = meshes_[static_cast<std::size_t>(model) - static_cast<std::size_t>(Model::file)];
  const auto [known, is_new] = files_.try_emplace(content_hash(mesh));
  if (is_new) known->second.mesh = upload(file_mesh(mesh));
  known->second.used = true;
  return known->second.mesh;
}

Groups MeshStore::add(const Batch& batch) {
  Groups groups;
  for (const auto& [model, instances] : batch) {
    groups.push_back({find(model), instances_.size(), instances.size(), model < Model::file});
    instances_.insert(instances_.end(), instances.begin(), instances.end());
  }
  return groups;
}

void MeshStore::end() {
  glBindBuffer(GL_ARRAY_BUFFER, buffer_);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(instances_.size() * sizeof(Instance)), instances_.data(),
               GL_STREAM_DRAW);
}

void draw(const Groups& groups, Faces faces) {
  for (const auto& group : groups) {
    if (faces == Faces::front && group.closed) {
      glEnable(GL_CULL_FACE);
    } else {
      glDisable(GL_CULL_FACE);
    }
    glBindVertexArray(group.mesh.array);
    read_instances_from(group.first);
    glDrawElementsInstanced(GL_TRIANGLES, group.mesh.count, GL_UNSIGNED_INT, nullptr,
                            static_cast<GLsizei>(group.count));
  }
  glDisable(GL_CULL_FACE);
}

}  // namespace subworld
