#include "gl_context.hpp"

#include "model/error.hpp"

#include <dlfcn.h>
#include <epoxy/gl.h>
#include <fmt/core.h>

#include <array>
#include <cstring>
#include <string>

namespace subworld {
namespace {

[[noreturn]] void fail(const std::string& what) {
  throw Error(ExitCode::failed,
              "pictures need EGL and OpenGL 3.3: " + what + " (cure: install libegl1, libgl1 and libgl1-mesa-dri)");
}

// epoxy aborts the process if it cannot open a library, so these are opened here first.
void require_library(std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (dlopen(name, RTLD_LAZY | RTLD_LOCAL) != nullptr) return;
  }
  fail(fmt::format("{} cannot be loaded", *names.begin()));
}

bool has_extension(EGLDisplay display, const char* name) {
  const char* all = eglQueryString(display, EGL_EXTENSIONS);
  return all != nullptr && fmt::format(" {} ", all).find(fmt::format(" {} ", name)) != std::string::npos;
}

EGLContext create_context(EGLDisplay display) {
  if (display == EGL_NO_DISPLAY || eglInitialize(display, nullptr, nullptr) == EGL_FALSE) return EGL_NO_CONTEXT;
  if (!has_extension(display, "EGL_KHR_surfaceless_context") || eglBindAPI(EGL_OPENGL_API) == EGL_FALSE) {
    return EGL_NO_CONTEXT;
  }
  const std::array<EGLint, 3> wanted{EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = EGL_NO_CONFIG_KHR;
  EGLint count = 0;
  if (!has_extension(display, "EGL_KHR_no_config_context") &&
      (eglChooseConfig(display, wanted.data(), &config, 1, &count) == EGL_FALSE || count == 0)) {
    return EGL_NO_CONTEXT;
  }
  const std::array<EGLint, 7> version{
      EGL_CONTEXT_MAJOR_VERSION,           3,       EGL_CONTEXT_MINOR_VERSION, 3, EGL_CONTEXT_OPENGL_PROFILE_MASK,
      EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
  return eglCreateContext(display, config, EGL_NO_CONTEXT, version.data());
}

std::array<EGLDeviceEXT, 16> devices(EGLint& count) {
  std::array<EGLDeviceEXT, 16> all{};
  const bool known = has_extension(EGL_NO_DISPLAY, "EGL_EXT_device_enumeration") ||
                     has_extension(EGL_NO_DISPLAY, "EGL_EXT_device_base");
  if (!known || eglQueryDevicesEXT(static_cast<EGLint>(all.size()), all.data(), &count) == EGL_FALSE) count = 0;
  return all;
}

}  // namespace

GlContext::GlContext() {
  require_library({"libEGL.so.1"});
  require_library({"libOpenGL.so.0", "libGL.so.1"});
  if (!has_extension(EGL_NO_DISPLAY, "EGL_EXT_platform_base")) fail("this EGL knows no platforms without a display");
  const auto attempt = [&](EGLenum platform, void* native) {
    display_ = eglGetPlatformDisplayEXT(platform, native, nullptr);
    context_ = create_context(display_);
    return context_ != EGL_NO_CONTEXT;
  };
  if (has_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless") &&
      attempt(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY)) {
    return;
  }
  EGLint count = 0;
  const auto all = devices(count);
  for (EGLint k = 0; k < count; ++k) {
    if (attempt(EGL_PLATFORM_DEVICE_EXT, all[k])) return;
  }
  fail("no driver gives a context without a display");
}

// Displays belong to the process and may be shared, so only the context is destroyed.
GlContext::~GlContext() { eglDestroyContext(display_, context_); }

GlContext::Current::Current(const GlContext& context) : display_(context.display_) {
  if (eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context.context_) == EGL_FALSE) {
    throw Error(ExitCode::failed, fmt::format("EGL refused the drawing context (error {:#x}); is it in use in another "
                                              "thread?",
                                              eglGetError()));
  }
}

GlContext::Current::~Current() { eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT); }

}  // namespace subworld
