#pragma once

#include <epoxy/egl.h>

namespace subworld {

/// OpenGL 3.3 core without a display: EGL on Mesa's surfaceless platform, else on the first suitable device. The
/// context is current in one thread at a time, while a `Current` exists.
class GlContext {
 public:
  /// Throws `Error` (failed) with the cure if EGL, OpenGL or the driver is missing.
  GlContext();
  ~GlContext();
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  class Current {
   public:
    explicit Current(const GlContext& context);
    ~Current();
    Current(const Current&) = delete;
    Current& operator=(const Current&) = delete;

   private:
    EGLDisplay display_;
  };

 private:
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
};

}  // namespace subworld
