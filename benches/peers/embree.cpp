// Embree 3 as a peer of `skylit bench rays`: loads a scene and sets of rays once, then times one pass whenever it is told to.
//
//   g++ -O3 -march=native -std=c++17 embree.cpp -o embree -lembree3 -lpthread
//
// One command a line on stdin, one JSON object a line on stdout; docs/reference/benchmarks.md has the protocol and the files' layout.
// Kernels: one ray or packets of 16, in a scene as Embree makes it by default or with RTC_SCENE_FLAG_ROBUST.
#include <embree3/rtcore.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <functional>
#include <iostream>
#include <limits>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#if defined(__SSE3__)
#include <pmmintrin.h>
#include <xmmintrin.h>
#endif

namespace {

struct Ray { float origin[3], tmin, direction[3], tmax; };
static_assert(sizeof(Ray) == 32, "the record of ray files");

struct Hit { float t; uint32_t placement, primitive; float u, v; };
static_assert(sizeof(Hit) == 20, "the record of hit files");

constexpr uint32_t NONE = ~0u;
constexpr uint32_t SCENE_MAGIC = 0x50594b53;  // "SKYP"
// rays that a thread takes at a time
constexpr size_t CHUNK = 4096;

struct Group {
    bool spheres = false;
    // x y z, or x y z radius; Embree reads 16 bytes at a time, so one float more than there are vertices
    std::vector<float> vertices;
    std::vector<uint32_t> indices;
    size_t vertex_count = 0, primitive_count = 0;
};

struct Placement { uint32_t group; float to_world[12]; };  // three rows

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

class File {
  public:
    File(const std::string& path, const char* mode) : path_(path), file_(std::fopen(path.c_str(), mode)) {
        if (!file_) throw std::runtime_error(path + ": cannot open");
    }
    ~File() { if (file_) std::fclose(file_); }
    File(const File&) = delete;
    File& operator=(const File&) = delete;
    template <class T> void read(T* to, size_t n) {
        if (std::fread(to, sizeof(T), n, file_) != n) throw std::runtime_error(path_ + ": ends too early");
    }
    template <class T> void write(const T* from, size_t n) {
        if (std::fwrite(from, sizeof(T), n, file_) != n) throw std::runtime_error(path_ + ": cannot write");
    }
    void close() {
        FILE* f = file_;
        file_ = nullptr;
        if (std::fclose(f) != 0) throw std::runtime_error(path_ + ": cannot write");
    }
    size_t size() {
        if (fseeko(file_, 0, SEEK_END) != 0) throw std::runtime_error(path_ + ": cannot seek");
        const auto n = ftello(file_);
        std::rewind(file_);
        return size_t(n);
    }

  private:
    std::string path_;
    FILE* file_;
};

std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
    return out + "\"";
}

// Threads that live as long as the process, so that a timed pass starts none.
class Pool {
  public:
    explicit Pool(unsigned threads) {
        for (unsigned k = 0; k < threads; k++) threads_.emplace_back([this] { work(); });
    }
    ~Pool() {
        { std::lock_guard<std::mutex> lock(mutex_); stop_ = true; turn_++; }
        wake_.notify_all();
        for (auto& t : threads_) t.join();
    }
    size_t size() const { return threads_.size(); }
    // `job` on every thread; returns when all are done.
    void run(const std::function<void()>& job) {
        std::unique_lock<std::mutex> lock(mutex_);
        job_ = &job;
        running_ = threads_.size();
        turn_++;
        wake_.notify_all();
        done_.wait(lock, [this] { return running_ == 0; });
    }

  private:
    void work() {
#if defined(__SSE3__)
        // as Embree's manual asks of whoever calls it
        _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
        _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
#endif
        uint64_t seen = 0;
        for (;;) {
            const std::function<void()>* job;
            {
                std::unique_lock<std::mutex> lock(mutex_);
                wake_.wait(lock, [&] { return turn_ != seen; });
                seen = turn_;
                if (stop_) return;
                job = job_;
            }
            (*job)();
            std::lock_guard<std::mutex> lock(mutex_);
            if (--running_ == 0) done_.notify_one();
        }
    }

    std::mutex mutex_;
    std::condition_variable wake_, done_;
    const std::function<void()>* job_ = nullptr;
    size_t running_ = 0;
    uint64_t turn_ = 0;
    bool stop_ = false;
    std::vector<std::thread> threads_;
};

bool is_identity(const float m[12]) {
    const float one[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    return std::equal(m, m + 12, one);
}

// A committed scene of Embree: default or robust.
struct Built { RTCScene top = nullptr; std::vector<RTCScene> groups; double seconds = 0; int64_t bytes = 0; };

class Peer {
  public:
    Peer() : pool_(std::max(1u, std::thread::hardware_concurrency())), device_(rtcNewDevice(nullptr)) {
        if (!device_) throw std::runtime_error("Embree does not start");
        rtcSetDeviceMemoryMonitorFunction(device_, [](void* self, ssize_t bytes, bool) {
            static_cast<Peer*>(self)->bytes_ += bytes;
            return true;
        }, this);
    }
    ~Peer() { forget(); rtcReleaseDevice(device_); }

    std::string hello() const {
        return "{\"protocol\":1,\"peer\":\"Embree " RTC_VERSION_STRING "\",\"threads\":" + std::to_string(pool_.size()) +
               ",\"kernels\":[\"one\",\"packet16\",\"robust-one\",\"robust-packet16\"]}";
    }

    // The answer to one command.
    std::string answer(const std::string& line) {
        const auto word = [&line](size_t& at) {
            const size_t end = std::min(line.find(' ', at), line.size());
            std::string w = line.substr(at, end - at);
            at = std::min(end + 1, line.size());
            return w;
        };
        size_t at = 0;
        const std::string command = word(at);
        if (command == "scene") { load_scene(line.substr(at)); return "{\"primitives\":" + std::to_string(primitives()) + "}"; }
        if (command == "rays") {
            const std::string name = word(at);
            auto& set = rays_[name];
            File file(line.substr(at), "rb");
            set.resize(file.size() / sizeof(Ray));
            file.read(set.data(), set.size());
            return "{\"rays\":" + std::to_string(set.size()) + "}";
        }
        if (command == "build") {
            const Built& b = built(word(at));
            return "{\"build_seconds\":" + std::to_string(b.seconds) + ",\"bytes\":" + std::to_string(b.bytes) + "}";
        }
        if (command == "trace" || command == "hits") {
            const std::string kernel = word(at), mode = word(at), name = word(at), path = line.substr(at);
            const auto set = rays_.find(name);
            if (set == rays_.end()) throw std::runtime_error("no rays are called " + name);
            if (mode != "any" && mode != "closest") throw std::runtime_error("no mode is called " + mode);
            std::vector<Hit> hits(command == "hits" ? set->second.size() : 0);
            size_t found = 0;
            const double seconds = trace(kernel, mode == "any", set->second, hits.empty() ? nullptr : hits.data(), found);
            if (command == "hits") {
                File file(path, "wb");
                file.write(hits.data(), hits.size());
                file.close();
            }
            char text[128];
            std::snprintf(text, sizeof text, "{\"seconds\":%.9f,\"hits\":%zu}", seconds, found);
            return text;
        }
        throw std::runtime_error("no command is called " + command);
    }

  private:
    size_t primitives() const {
        size_t n = 0;
        for (const auto& g : groups_) n += g.primitive_count;
        return n;
    }

    void check(const char* what) {
        const RTCError e = rtcGetDeviceError(device_);
        if (e == RTC_ERROR_NONE) return;
        throw std::runtime_error(std::string(what) + (e == RTC_ERROR_OUT_OF_MEMORY ? ": out of memory" : ": Embree error " + std::to_string(e)));
    }

    void forget() {
        for (auto& [name, b] : built_) {
            for (auto s : b.groups) if (s) rtcReleaseScene(s);
            if (b.top) rtcReleaseScene(b.top);
        }
        built_.clear();
        rays_.clear();
        groups_.clear();
        placements_.clear();
    }

    void load_scene(const std::string& path) {
        forget();
        File file(path, "rb");
        uint32_t head[4];
        file.read(head, 4);
        if (head[0] != SCENE_MAGIC || head[1] != 1) throw std::runtime_error(path + ": no scene of this version");
        for (uint32_t k = 0; k < head[2]; k++) {
            uint32_t counts[3];
            file.read(counts, 3);
            Group g;
            g.spheres = counts[0] != 0;
            g.vertex_count = counts[1];
            g.primitive_count = counts[2];
            const size_t floats = g.vertex_count * (g.spheres ? 4 : 3);
            g.vertices.resize(floats + 4);
            file.read(g.vertices.data(), floats);
            if (!g.spheres) {
                g.indices.resize(3 * g.primitive_count);
                file.read(g.indices.data(), g.indices.size());
            }
            groups_.push_back(std::move(g));
        }
        placements_.resize(head[3]);
        for (auto& p : placements_) {
            file.read(&p.group, 1);
            file.read(p.to_world, 12);
            if (p.group >= groups_.size()) throw std::runtime_error(path + ": a placement of no group");
        }
    }

    RTCGeometry geometry(const Group& g) {
        RTCGeometry out = rtcNewGeometry(device_, g.spheres ? RTC_GEOMETRY_TYPE_SPHERE_POINT : RTC_GEOMETRY_TYPE_TRIANGLE);
        const void* vertices = g.vertices.data();
        if (g.spheres) {
            rtcSetSharedGeometryBuffer(out, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, vertices, 0, 16, g.vertex_count);
        } else {
            rtcSetSharedGeometryBuffer(out, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices, 0, 12, g.vertex_count);
            rtcSetSharedGeometryBuffer(out, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, g.indices.data(), 0, 12, g.primitive_count);
        }
        rtcCommitGeometry(out);
        return out;
    }

    RTCScene new_scene(bool robust) {
        RTCScene s = rtcNewScene(device_);
        rtcSetSceneFlags(s, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
        return s;
    }

    // The scene that a kernel traces, built on first use. Geometry that needs no transform lies in the top level itself.
    Built& built(const std::string& kernel) {
        const bool robust = kernel.rfind("robust-", 0) == 0;
        Built& b = built_[robust];
        if (b.top) return b;
        const int64_t before = bytes_;
        const auto start = std::chrono::steady_clock::now();
        b.groups.assign(groups_.size(), nullptr);
        b.top = new_scene(robust);
        for (uint32_t id = 0; id < placements_.size(); id++) {
            const Placement& p = placements_[id];
            RTCGeometry g;
            if (is_identity(p.to_world)) {
                g = geometry(groups_[p.group]);
            } else {
                RTCScene& inner = b.groups[p.group];
                if (!inner) {
                    inner = new_scene(robust);
                    RTCGeometry part = geometry(groups_[p.group]);
                    rtcAttachGeometry(inner, part);
                    rtcReleaseGeometry(part);
                    rtcCommitScene(inner);
                }
                g = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
                rtcSetGeometryInstancedScene(g, inner);
                rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, p.to_world);
                rtcCommitGeometry(g);
            }
            rtcAttachGeometryByID(b.top, g, id);
            rtcReleaseGeometry(g);
        }
        rtcCommitScene(b.top);
        b.seconds = seconds_since(start);
        b.bytes = bytes_ - before;
        check("build");
        return b;
    }

    static void put(RTCRay& to, const Ray& r) {
        to.org_x = r.origin[0]; to.org_y = r.origin[1]; to.org_z = r.origin[2]; to.tnear = r.tmin;
        to.dir_x = r.direction[0]; to.dir_y = r.direction[1]; to.dir_z = r.direction[2]; to.tfar = r.tmax;
        to.time = 0; to.mask = ~0u; to.id = 0; to.flags = 0;
    }

    static void put(RTCRay16& to, size_t j, const Ray& r) {
        to.org_x[j] = r.origin[0]; to.org_y[j] = r.origin[1]; to.org_z[j] = r.origin[2]; to.tnear[j] = r.tmin;
        to.dir_x[j] = r.direction[0]; to.dir_y[j] = r.direction[1]; to.dir_z[j] = r.direction[2]; to.tfar[j] = r.tmax;
        to.time[j] = 0; to.mask[j] = ~0u; to.id[j] = 0; to.flags[j] = 0;
    }

    static Hit miss() { return {std::numeric_limits<float>::infinity(), NONE, NONE, 0, 0}; }

    static size_t one(RTCScene scene, bool any, const Ray* rays, size_t n, Hit* hits) {
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        size_t found = 0;
        for (size_t i = 0; i < n; i++) {
            RTCRayHit x;
            put(x.ray, rays[i]);
            Hit h = miss();
            bool hit;
            if (any) {
                rtcOccluded1(scene, &context, &x.ray);
                hit = x.ray.tfar < 0;
                if (hit) h.t = 0;
            } else {
                x.hit.geomID = x.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
                rtcIntersect1(scene, &context, &x);
                hit = x.hit.geomID != RTC_INVALID_GEOMETRY_ID;
                if (hit) {
                    const uint32_t instance = x.hit.instID[0];
                    h = {x.ray.tfar, instance != RTC_INVALID_GEOMETRY_ID ? instance : x.hit.geomID, x.hit.primID, x.hit.u, x.hit.v};
                }
            }
            found += hit;
            if (hits) hits[i] = h;
        }
        return found;
    }

    static size_t packet16(RTCScene scene, bool any, const Ray* rays, size_t n, Hit* hits) {
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        size_t found = 0;
        for (size_t first = 0; first < n; first += 16) {
            const size_t count = std::min<size_t>(16, n - first);
            alignas(64) int valid[16];
            RTCRayHit16 x;
            for (size_t j = 0; j < 16; j++) {
                valid[j] = j < count ? -1 : 0;
                put(x.ray, j, rays[first + (j < count ? j : 0)]);
                x.hit.geomID[j] = x.hit.instID[0][j] = RTC_INVALID_GEOMETRY_ID;
            }
            if (any) rtcOccluded16(valid, scene, &context, &x.ray);
            else rtcIntersect16(valid, scene, &context, &x);
            for (size_t j = 0; j < count; j++) {
                const bool hit = any ? x.ray.tfar[j] < 0 : x.hit.geomID[j] != RTC_INVALID_GEOMETRY_ID;
                found += hit;
                if (!hits) continue;
                Hit h = miss();
                if (hit && any) h.t = 0;
                if (hit && !any) {
                    const uint32_t instance = x.hit.instID[0][j];
                    h = {x.ray.tfar[j], instance != RTC_INVALID_GEOMETRY_ID ? instance : x.hit.geomID[j], x.hit.primID[j],
                         x.hit.u[j], x.hit.v[j]};
                }
                hits[first + j] = h;
            }
        }
        return found;
    }

    // Seconds of one pass over the set on all threads; each takes the next chunk when it has done its last.
    double trace(const std::string& kernel, bool any, const std::vector<Ray>& rays, Hit* hits, size_t& found) {
        const std::string plain = kernel.rfind("robust-", 0) == 0 ? kernel.substr(7) : kernel;
        if (plain != "one" && plain != "packet16") throw std::runtime_error("no kernel is called " + kernel);
        const RTCScene scene = built(kernel).top;
        const auto run = plain == "one" ? one : packet16;
        std::atomic<size_t> next{0}, sum{0};
        const std::function<void()> job = [&] {
            size_t mine = 0, first;
            while ((first = next.fetch_add(CHUNK)) < rays.size()) {
                const size_t n = std::min(CHUNK, rays.size() - first);
                mine += run(scene, any, &rays[first], n, hits ? hits + first : nullptr);
            }
            sum += mine;
        };
        const auto start = std::chrono::steady_clock::now();
        pool_.run(job);
        const double seconds = seconds_since(start);
        found = sum;
        check("trace");
        return seconds;
    }

    Pool pool_;
    RTCDevice device_;
    std::atomic<int64_t> bytes_{0};
    std::vector<Group> groups_;
    std::vector<Placement> placements_;
    std::unordered_map<bool, Built> built_;
    std::unordered_map<std::string, std::vector<Ray>> rays_;
};

}  // namespace

int main() {
    try {
        Peer peer;
        std::cout << peer.hello() << std::endl;
        for (std::string line; std::getline(std::cin, line);) {
            if (line == "quit") break;
            try {
                std::cout << peer.answer(line) << std::endl;
            } catch (const std::exception& e) {
                std::cout << "{\"error\":" << quoted(e.what()) << "}" << std::endl;
            }
        }
    } catch (const std::exception& e) {
        std::cout << "{\"error\":" << quoted(e.what()) << "}" << std::endl;
        return 1;
    }
    return 0;
}
