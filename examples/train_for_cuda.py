"""A trainer in the style of 3DGS, written for CUDA: ``gspure cuda-free -- python examples/train_for_cuda.py``."""

import math

import torch
from diff_gaussian_rasterization import GaussianRasterizationSettings, GaussianRasterizer
from fused_ssim import fused_ssim
from simple_knn._C import distCUDA2

torch.manual_seed(0)
tan = math.tan(0.4)
view = torch.eye(4).cuda()
view[3, 2] = 4.0
projection = torch.tensor([[1 / tan, 0, 0, 0], [0, 1 / tan, 0, 0], [0, 0, 1, 1], [0, 0, -0.01, 0]], device="cuda")
background = torch.zeros(3, dtype=torch.float32, device="cuda")


def render(xyz, features, opacity, scaling, rotation):
    """Return an image [3,H,W], the centres for gradients in it, and the radii."""
    points = torch.zeros_like(xyz, requires_grad=True, device="cuda") + 0
    points.retain_grad()
    settings = GaussianRasterizationSettings(
        image_height=32,
        image_width=32,
        tanfovx=tan,
        tanfovy=tan,
        bg=background,
        scale_modifier=1.0,
        viewmatrix=view,
        projmatrix=view @ projection,
        sh_degree=0,
        campos=view.inverse()[3, :3],
        prefiltered=False,
        debug=False,
        antialiasing=False,
    )
    image, radii, _ = GaussianRasterizer(raster_settings=settings)(
        means3D=xyz,
        means2D=points,
        shs=features,
        colors_precomp=None,
        opacities=torch.sigmoid(opacity),
        scales=torch.exp(scaling),
        rotations=torch.nn.functional.normalize(rotation),
        cov3D_precomp=None,
    )
    return image.clamp(0, 1), points, radii


def parameters():
    """Return random parameters of 60 Gaussians."""
    xyz = torch.rand(60, 3, device="cuda") - 0.5
    scaling = torch.log(torch.sqrt(distCUDA2(xyz.float().cuda())))[..., None].repeat(1, 3)
    rotation = torch.zeros((60, 4), device="cuda")
    rotation[:, 0] = 1
    values = [xyz, torch.rand(60, 1, 3).to("cuda"), torch.zeros(60, 1, device="cuda"), scaling, rotation]
    return [torch.nn.Parameter(value.requires_grad_()) for value in values]


truth = render(*parameters())[0].detach()
model = parameters()
optimizer = torch.optim.Adam(model, lr=0.01, eps=1e-15)
start = torch.cuda.Event(enable_timing=True)
end = torch.cuda.Event(enable_timing=True)
start.record()
for _ in range(30):
    image, points, radii = render(*model)
    loss = 0.8 * (image - truth).abs().mean() + 0.2 * (1 - fused_ssim(image[None], truth[None]))
    loss.backward()
    norms = torch.norm(points.grad[radii > 0, :2], dim=-1)
    optimizer.step()
    optimizer.zero_grad(set_to_none=True)
    print(loss.item(), norms.max().item())
end.record()
torch.cuda.synchronize()
print(f"{start.elapsed_time(end):.0f} ms")
torch.save(model, "model.pth")
