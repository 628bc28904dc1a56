// The array types that cross the border to Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <stdexcept>
#include <vector>

#include "geometry.hpp"

namespace nb = nanobind;

template <class T>
using Array = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using Bytes2 = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Bytes3 = nb::ndarray<const std::uint8_t, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

inline oath::Vec vector(const Points& points, std::size_t i) {
    return {points.data()[2 * i], points.data()[2 * i + 1]};
}

inline std::vector<oath::Vec> vectors(const Points& points) {
    std::vector<oath::Vec> out(points.shape(0));
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = vector(points, i);
    return out;
}

template <class A, class B>
void same_length(const A& a, const B& b) {
    if (a.shape(0) != b.shape(0)) throw std::invalid_argument("arrays differ in length");
}

// Hand a vector's memory over to a numpy array of this shape.
template <class T>
nb::ndarray<nb::numpy, T> array(std::vector<T>&& values, std::initializer_list<std::size_t> shape) {
    auto* owned = new std::vector<T>(std::move(values));
    nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return nb::ndarray<nb::numpy, T>(owned->data(), shape, owner);
}

template <class T>
nb::ndarray<nb::numpy, T> array(std::vector<T>&& values) {
    const std::size_t n = values.size();
    return array(std::move(values), {n});
}
