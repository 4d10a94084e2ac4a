// The Embree side of the comparison. Usage: embree_side SCENE ROBUST(0|1) CONFIG RAYS...
// Prints "built SECONDS", then answers each line of standard input, "closest|any SET THREADS", with
// "SECONDS HITS SUM": seconds of all rays of the set, how many hit, and the sum of their distances.
// Works with Embree 3 (Debian's libembree-dev) and, with -DEMBREE4, with Embree 4.
#ifdef EMBREE4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#include <pmmintrin.h>
#include <time.h>
#include <xmmintrin.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <thread>
#include <vector>

namespace {

struct Ray {
  float origin[3], direction[3], t_max, time;
};

struct Matrix {
  float m[12];  // three rows of four
};

struct Shape {
  std::vector<unsigned> triangles;
  std::vector<std::vector<float>> keys;
  unsigned vertices;
};

struct Placed {
  unsigned shape;
  std::vector<Matrix> keys;
};

struct Scene {
  std::vector<Shape> shapes;
  std::vector<Placed> placed;
  bool turns;
};

double now(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

void check(bool good, const char* what) {
  if (!good) {
    std::fprintf(stderr, "embree_side: %s\n", what);
    std::exit(1);
  }
}

template <class T>
void read(FILE* file, T* to, size_t count) {
  check(std::fread(to, sizeof(T), count, file) == count, "a file is too short");
}

unsigned read_count(FILE* file) {
  unsigned n;
  read(file, &n, 1);
  return n;
}

FILE* open(const char* path) {
  FILE* file = std::fopen(path, "rb");
  check(file != nullptr, path);
  return file;
}

Scene read_scene(const char* path) {
  FILE* file = open(path);
  Scene scene;
  scene.turns = read_count(file) != 0;
  scene.shapes.resize(read_count(file));
  for (Shape& s : scene.shapes) {
    s.vertices = read_count(file);
    s.triangles.resize(3 * size_t(read_count(file)));
    s.keys.resize(read_count(file));
    read(file, s.triangles.data(), s.triangles.size());
    for (auto& key : s.keys) {
      key.resize(3 * size_t(s.vertices));
      read(file, key.data(), key.size());
    }
  }
  scene.placed.resize(read_count(file));
  for (Placed& p : scene.placed) {
    p.shape = read_count(file);
    p.keys.resize(read_count(file));
    read(file, p.keys.data(), p.keys.size());
  }
  std::fclose(file);
  return scene;
}

std::vector<Ray> read_rays(const char* path) {
  FILE* file = open(path);
  std::vector<Ray> rays(read_count(file));
  read(file, rays.data(), rays.size());
  std::fclose(file);
  return rays;
}

RTCGeometry mesh(RTCDevice device, const Shape& s) {
  RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryTimeStepCount(g, unsigned(s.keys.size()));
  for (unsigned k = 0; k < s.keys.size(); k++) {
    void* v = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, k, RTC_FORMAT_FLOAT3, 12, s.vertices);
    std::memcpy(v, s.keys[k].data(), s.keys[k].size() * 4);
  }
  void* i = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, s.triangles.size() / 3);
  std::memcpy(i, s.triangles.data(), s.triangles.size() * 4);
  rtcSetGeometryBuildQuality(g, RTC_BUILD_QUALITY_MEDIUM);
  rtcCommitGeometry(g);
  return g;
}

// Scale, rotation and translation of a matrix without shear or mirror.
RTCQuaternionDecomposition decomposed(const Matrix& matrix) {
  const float* m = matrix.m;
  float scale = std::sqrt(m[0] * m[0] + m[4] * m[4] + m[8] * m[8]);
  float r[3][3];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) r[i][j] = m[4 * i + j] / scale;
  float w = std::sqrt(std::fmax(0.f, 1 + r[0][0] + r[1][1] + r[2][2])) / 2;
  float x = std::copysign(std::sqrt(std::fmax(0.f, 1 + r[0][0] - r[1][1] - r[2][2])) / 2, r[2][1] - r[1][2]);
  float y = std::copysign(std::sqrt(std::fmax(0.f, 1 - r[0][0] + r[1][1] - r[2][2])) / 2, r[0][2] - r[2][0]);
  float z = std::copysign(std::sqrt(std::fmax(0.f, 1 - r[0][0] - r[1][1] + r[2][2])) / 2, r[1][0] - r[0][1]);
  RTCQuaternionDecomposition q;
  rtcInitQuaternionDecomposition(&q);
  q.scale_x = q.scale_y = q.scale_z = scale;
  q.quaternion_r = w, q.quaternion_i = x, q.quaternion_j = y, q.quaternion_k = z;
  q.translation_x = m[3], q.translation_y = m[7], q.translation_z = m[11];
  return q;
}

RTCScene new_scene(RTCDevice device, bool robust) {
  RTCScene s = rtcNewScene(device);
  rtcSetSceneFlags(s, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
  rtcSetSceneBuildQuality(s, RTC_BUILD_QUALITY_MEDIUM);
  return s;
}

void attach(RTCScene scene, RTCGeometry g) {
  rtcAttachGeometry(scene, g);
  rtcReleaseGeometry(g);
}

RTCScene build(RTCDevice device, const Scene& scene, bool robust) {
  RTCScene top = new_scene(device, robust);
  std::vector<RTCScene> bodies(scene.shapes.size(), nullptr);
  for (const Placed& p : scene.placed) {
    // The first shape stands for itself; the others are instanced.
    if (p.shape == 0) {
      attach(top, mesh(device, scene.shapes[0]));
      continue;
    }
    RTCScene& body = bodies[p.shape];
    if (!body) {
      body = new_scene(device, robust);
      attach(body, mesh(device, scene.shapes[p.shape]));
      rtcCommitScene(body);
    }
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(g, body);
    unsigned keys = p.keys.size() > 1 ? 2 : 1;
    rtcSetGeometryTimeStepCount(g, keys);
    for (unsigned k = 0; k < keys; k++) {
      const Matrix& m = k == 0 ? p.keys.front() : p.keys.back();
      if (scene.turns) {
        RTCQuaternionDecomposition q = decomposed(m);
        rtcSetGeometryTransformQuaternion(g, k, &q);
      } else {
        rtcSetGeometryTransform(g, k, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, m.m);
      }
    }
    rtcCommitGeometry(g);
    attach(top, g);
  }
  rtcCommitScene(top);
  return top;
}

void load(RTCRay& to, const Ray& r) {
  to.org_x = r.origin[0], to.org_y = r.origin[1], to.org_z = r.origin[2];
  to.dir_x = r.direction[0], to.dir_y = r.direction[1], to.dir_z = r.direction[2];
  to.tnear = 0, to.tfar = r.t_max, to.time = r.time;
  to.mask = unsigned(-1), to.id = 0, to.flags = 0;
}

struct Result {
  size_t hits = 0;
  double sum = 0;
};

Result trace(RTCScene scene, const Ray* rays, size_t count, bool any) {
  Result result;
#ifndef EMBREE4
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
#endif
  alignas(64) RTCRayHit h;
  for (size_t i = 0; i < count; i++) {
    load(h.ray, rays[i]);
    if (any) {
#ifdef EMBREE4
      rtcOccluded1(scene, &h.ray, nullptr);
#else
      rtcOccluded1(scene, &context, &h.ray);
#endif
      result.hits += h.ray.tfar < 0;
    } else {
      h.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      h.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#ifdef EMBREE4
      rtcIntersect1(scene, &h, nullptr);
#else
      rtcIntersect1(scene, &context, &h);
#endif
      if (h.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
        result.hits++;
        result.sum += h.ray.tfar;
      }
    }
  }
  return result;
}

void fast_denormals() {
  _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
  _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
}

}  // namespace

int main(int argc, char** argv) {
  check(argc >= 5, "usage: embree_side SCENE ROBUST CONFIG RAYS...");
  fast_denormals();
  Scene scene = read_scene(argv[1]);
  RTCDevice device = rtcNewDevice(argv[3]);
  check(device != nullptr, "no Embree device");
  double start = now(CLOCK_MONOTONIC);
  RTCScene top = build(device, scene, std::atoi(argv[2]) != 0);
  std::printf("built %.6f\n", now(CLOCK_MONOTONIC) - start);
  std::fflush(stdout);
  std::vector<std::vector<Ray>> sets;
  for (int i = 4; i < argc; i++) sets.push_back(read_rays(argv[i]));
  char goal[16];
  unsigned set, threads;
  while (std::scanf("%15s %u %u", goal, &set, &threads) == 3) {
    const std::vector<Ray>& rays = sets.at(set);
    bool any = !std::strcmp(goal, "any");
    Result all;
    double seconds;
    if (threads == 1) {
      double from = now(CLOCK_THREAD_CPUTIME_ID);
      all = trace(top, rays.data(), rays.size(), any);
      seconds = now(CLOCK_THREAD_CPUTIME_ID) - from;
    } else {
      double from = now(CLOCK_MONOTONIC);
      std::atomic<size_t> next{0};
      std::vector<Result> results(threads);
      std::vector<std::thread> crew;
      for (unsigned t = 0; t < threads; t++)
        crew.emplace_back([&, t] {
          fast_denormals();
          const size_t chunk = 4096;
          for (size_t i; (i = next.fetch_add(chunk)) < rays.size();) {
            Result r = trace(top, rays.data() + i, std::min(chunk, rays.size() - i), any);
            results[t].hits += r.hits;
            results[t].sum += r.sum;
          }
        });
      for (auto& t : crew) t.join();
      seconds = now(CLOCK_MONOTONIC) - from;
      for (auto& r : results) all.hits += r.hits, all.sum += r.sum;
    }
    std::printf("%.6f %zu %.9g\n", seconds, all.hits, all.sum);
    std::fflush(stdout);
  }
}
