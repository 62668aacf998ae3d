#include "gl_canvas.hpp"

#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <unordered_map>

namespace subworld {
namespace {

constexpr GLsizei kSamples = 4;
constexpr GLsizei kShadowPixels = 2048;

GLuint compile(GLenum kind, const char* source) {
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  GLint good = GL_FALSE;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
  if (good == GL_FALSE) {
    std::array<char, 1024> log{};
    glGetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw Error(ExitCode::failed, fmt::format("the OpenGL driver refuses a shader: {}", log.data()));
  }
  return shader;
}

void require_complete(const char* what) {
  const GLenum status = glCheckFramebufferStatus(GL_FRAMEBUFFER);
  if (status == GL_FRAMEBUFFER_COMPLETE) return;
  throw Error(ExitCode::failed, fmt::format("the OpenGL driver cannot draw into {} (status {:#x})", what, status));
}

GLuint attach_renderbuffer(GLenum attachment, GLenum format, GLsizei samples, PictureSize size) {
  GLuint buffer = 0;
  glGenRenderbuffers(1, &buffer);
  glBindRenderbuffer(GL_RENDERBUFFER, buffer);
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, size.width, size.height);
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, attachment, GL_RENDERBUFFER, buffer);
  return buffer;
}

GLuint new_framebuffer() {
  GLuint frame = 0;
  glGenFramebuffers(1, &frame);
  glBindFramebuffer(GL_FRAMEBUFFER, frame);
  return frame;
}

struct Indexed {
  ShapeMesh vertices;
  std::vector<GLuint> indices;
};

// Merges equal vertices: with a software driver, time is proportional to the vertices.
Indexed share(const ShapeMesh& mesh) {
  Indexed result;
  std::unordered_map<std::string_view, GLuint> known;
  for (const auto& vertex : mesh) {
    const std::string_view bytes(reinterpret_cast<const char*>(&vertex), sizeof(vertex));
    const auto [place, is_new] = known.try_emplace(bytes, static_cast<GLuint>(result.vertices.size()));
    if (is_new) result.vertices.push_back(vertex);
    result.indices.push_back(place->second);
  }
  return result;
}

}  // namespace

GlProgram::GlProgram(const char* vertex, const std::string& fragment) : id_(glCreateProgram()) {
  glAttachShader(id_, compile(GL_VERTEX_SHADER, vertex));
  glAttachShader(id_, compile(GL_FRAGMENT_SHADER, fragment.c_str()));
  glLinkProgram(id_);
  GLint good = GL_FALSE;
  glGetProgramiv(id_, GL_LINK_STATUS, &good);
  if (good == GL_FALSE) {
    std::array<char, 1024> log{};
    glGetProgramInfoLog(id_, static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw Error(ExitCode::failed, fmt::format("the OpenGL driver cannot link a program: {}", log.data()));
  }
}

void GlProgram::use() const { glUseProgram(id_); }
GLint GlProgram::place(const char* name) const { return glGetUniformLocation(id_, name); }
void GlProgram::set(const char* name, float value) const { glUniform1f(place(name), value); }
void GlProgram::set(const char* name, int value) const { glUniform1i(place(name), value); }
void GlProgram::set(const char* name, const Eigen::Vector2f& value) const {
  glUniform2fv(place(name), 1, value.data());
}
void GlProgram::set(const char* name, const Eigen::Vector3f& value) const {
  glUniform3fv(place(name), 1, value.data());
}
void GlProgram::set(const char* name, const Eigen::Matrix4f& value) const {
  glUniformMatrix4fv(place(name), 1, GL_FALSE, value.data());
}

void describe_attribute(GLuint location, GLint size, std::size_t stride, std::size_t offset, GLuint divisor) {
  glEnableVertexAttribArray(location);
  // OpenGL takes offsets into the bound buffer as pointers.
  glVertexAttribPointer(location, size, GL_FLOAT, GL_FALSE, static_cast<GLsizei>(stride),
                        reinterpret_cast<const void*>(offset));  // NOLINT(performance-no-int-to-ptr)
  glVertexAttribDivisor(location, divisor);
}

GlMesh upload(const ShapeMesh& mesh) {
  const Indexed indexed = share(mesh);
  GlMesh result;
  glGenVertexArrays(1, &result.array);
  glBindVertexArray(result.array);
  glGenBuffers(1, &result.vertices);
  glBindBuffer(GL_ARRAY_BUFFER, result.vertices);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(indexed.vertices.size() * sizeof(MeshVertex)),
               indexed.vertices.data(), GL_STATIC_DRAW);
  describe_attribute(0, 3, sizeof(MeshVertex), offsetof(MeshVertex, position));
  describe_attribute(1, 3, sizeof(MeshVertex), offsetof(MeshVertex, normal));
  describe_attribute(2, 3, sizeof(MeshVertex), offsetof(MeshVertex, edge));
  describe_attribute(3, 1, sizeof(MeshVertex), offsetof(MeshVertex, stretch));
  glGenBuffers(1, &result.indices);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, result.indices);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(indexed.indices.size() * sizeof(GLuint)),
               indexed.indices.data(), GL_STATIC_DRAW);
  result.count = static_cast<GLsizei>(indexed.indices.size());
  return result;
}

void release(const GlMesh& mesh) {
  glDeleteVertexArrays(1, &mesh.array);
  glDeleteBuffers(1, &mesh.vertices);
  glDeleteBuffers(1, &mesh.indices);
}

GlTarget::GlTarget(PictureSize size) : size_(size) {
  GLint most = 0;
  glGetIntegerv(GL_MAX_SAMPLES, &most);
  const GLsizei samples = std::min(kSamples, static_cast<GLsizei>(most));
  drawn_ = new_framebuffer();
  attach_renderbuffer(GL_COLOR_ATTACHMENT0, GL_RGBA8, samples, size);
  attach_renderbuffer(GL_DEPTH_STENCIL_ATTACHMENT, GL_DEPTH24_STENCIL8, samples, size);
  require_complete("a picture of that size");
  averaged_ = new_framebuffer();
  attach_renderbuffer(GL_COLOR_ATTACHMENT0, GL_RGBA8, 0, size);
  require_complete("a picture of that size");
}

void GlTarget::bind() const {
  glBindFramebuffer(GL_FRAMEBUFFER, drawn_);
  glViewport(0, 0, size_.width, size_.height);
}

Image GlTarget::read() const {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, drawn_);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, averaged_);
  glBlitFramebuffer(0, 0, size_.width, size_.height, 0, 0, size_.width, size_.height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, averaged_);
  const std::size_t row = 3 * static_cast<std::size_t>(size_.width);
  std::vector<std::uint8_t> upwards(row * static_cast<std::size_t>(size_.height));
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, size_.width, size_.height, GL_RGB, GL_UNSIGNED_BYTE, upwards.data());
  Image image{size_.width, size_.height, std::vector<std::uint8_t>(upwards.size())};
  for (std::size_t k = 0; k < upwards.size() / row; ++k) {
    std::copy_n(upwards.end() - static_cast<std::ptrdiff_t>((k + 1) * row), row,
                image.rgb.begin() + static_cast<std::ptrdiff_t>(k * row));
  }
  return image;
}

GlShadowMap::GlShadowMap() {
  glGenTextures(1, &texture_);
  glBindTexture(GL_TEXTURE_2D, texture_);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, kShadowPixels, kShadowPixels, 0, GL_DEPTH_COMPONENT,
               GL_UNSIGNED_INT, nullptr);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  frame_ = new_framebuffer();
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, texture_, 0);
  glDrawBuffer(GL_NONE);
  glReadBuffer(GL_NONE);
  require_complete("a shadow map");
}

void GlShadowMap::bind() const {
  glBindFramebuffer(GL_FRAMEBUFFER, frame_);
  glViewport(0, 0, kShadowPixels, kShadowPixels);
}

int GlShadowMap::width() { return kShadowPixels; }

void GlShadowMap::bind_texture() const {
  glActiveTexture(GL_TEXTURE0);
  glBindTexture(GL_TEXTURE_2D, texture_);
}

}  // namespace subworld
