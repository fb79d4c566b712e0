// Times the public C++ BINPAT (cvar-upm/multi_uav_planning_binpat, not part of this repository) on the area that
// `bench/coverage.rs` plans: microseconds, median of many runs. Arguments: vehicles, runs.
// Build: g++ -O3 -march=native -std=c++17 -I REPO/planning_binpat/include
//        -I REPO/planning_binpat/include/assignment/bare binpat.cpp REPO/planning_binpat/src/bare/lap.cpp

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <vector>

#include "plan.hpp"

/// Of each route before the loss: nine steps of 10 m, from its first waypoint to its tenth.
const float FLOWN_M = 90.f;

template <typename Run>
double median_us(int runs, Run &&run) {
    std::vector<double> times;
    for (int i = 0; i < runs; ++i) {
        times.push_back(run());
    }
    std::nth_element(times.begin(), times.begin() + runs / 2, times.end());
    return times[runs / 2];
}

template <typename Work>
double time_us(Work &&work) {
    auto begin = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count();
}

int main(int argc, char **argv) {
    const int vehicles = argc > 1 ? std::atoi(argv[1]) : 3;
    const int runs = argc > 2 ? std::atoi(argv[2]) : 501;
    std::vector vertices{gmt::point<2u>(0.f, 0.f), gmt::point<2u>(300.f, 0.f), gmt::point<2u>(320.f, 80.f),
                         gmt::point<2u>(300.f, 150.f), gmt::point<2u>(0.f, 150.f)};
    std::vector<gmt::point<3u>> homes;
    for (int i = 0; i < vehicles; ++i) {
        homes.emplace_back(5.f * i, -10.f, 0.f);
    }
    auto homeset = seq::make_range_sequence(homes);
    pln::parameters parameters(10.f, 40.f, 5.f, 35.f);
    auto polygon = gmt::make_polygon(gmt::make_chain(seq::make_range_sequence(vertices)));
    std::vector regions{pln::make_region(polygon, gmt::point<2u>(0.f, 10.f))};
    auto regionset = seq::make_range_sequence(regions);

    std::size_t points = 0;
    double plan_us = median_us(runs, [&] {
        return time_us([&] {
            auto plan = pln::generate_plan(regionset, homeset, parameters);
            points += !seq::empty(plan);
        });
    });
    double update_us = median_us(runs, [&] {
        auto plan = pln::generate_plan(regionset, homeset, parameters);
        // Each has flown FLOWN_M of its route and stands there; the first is lost. A path begins where its vehicle is.
        auto lose = [](auto &&path) {
            auto index = path.getindex() == 0 ? idx::null : path.getindex();
            using Point = typename std::decay_t<decltype(path)>::value_type;
            auto points = seq::accumulate<std::vector<Point>>(path.getchain());
            auto next = std::find_if(points.begin(), points.end(), [](auto &point) { return point.getlabel(); });
            float left_m = FLOWN_M;
            auto here = next->getpoint();
            while (++next != points.end() && next->getlabel()) {
                auto step = next->getpoint() - here;
                float step_m = gmt::pnt::separation(here, next->getpoint());
                if (step_m >= left_m) {
                    here = here + step * (left_m / step_m);
                    break;
                }
                left_m -= step_m;
                here = next->getpoint();
            }
            std::vector<Point> rest{lbl::make_point(true, here)};
            rest.insert(rest.end(), next, points.end());
            return idx::make_chain(index, gmt::make_chain(seq::make_container_sequence(std::move(rest))));
        };
        auto lost = gmt::make_scrawl(seq::make_container_sequence_(seq::transform(lose, std::move(plan))));
        return time_us([&] {
            auto updated = pln::update_plan(std::move(lost), parameters, .9f);
            points += updated.has_value();
        });
    });
    std::cout << plan_us << ' ' << update_us << std::endl;
    return points == 0;
}
